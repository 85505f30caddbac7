"""Rotations: quaternions and matrices say the same."""

from __future__ import annotations

import math

import pytest
import torch

from semgs.geometry.rotations import (
    covariance,
    matrix_from_quaternion,
    nearest_rotation,
    quaternion_from_matrix,
    quaternion_product,
)

HALF_TURNS = [[0.0, 1, 0, 0], [0, 0, 1, 0], [0, 0, 0, 1], [0, 0.6, 0.8, 0], [0, 0.6, 0, -0.8], [0, 1 / 3, 2 / 3, 2 / 3]]


def some_quaternions(count: int = 200) -> torch.Tensor:
    values = torch.randn(count, 4, generator=torch.Generator().manual_seed(0), dtype=torch.float64)
    return torch.nn.functional.normalize(values, dim=-1)


def test_a_quarter_turn_about_z_takes_x_to_y():
    turn = matrix_from_quaternion(torch.tensor([math.cos(math.pi / 4), 0, 0, math.sin(math.pi / 4)]))
    torch.testing.assert_close(turn @ torch.tensor([1.0, 0, 0]), torch.tensor([0.0, 1, 0]))


def test_matrices_of_quaternions_are_rotations_whatever_their_length():
    matrices = matrix_from_quaternion(some_quaternions() * 7)
    torch.testing.assert_close(matrices @ matrices.mT, torch.eye(3, dtype=torch.float64).expand_as(matrices))
    torch.testing.assert_close(torch.linalg.det(matrices), torch.ones(200, dtype=torch.float64))


@pytest.mark.parametrize("quaternions", [some_quaternions(), torch.tensor(HALF_TURNS, dtype=torch.float64)])
def test_the_quaternion_of_a_matrix_gives_the_matrix_back(quaternions):
    matrices = matrix_from_quaternion(quaternions)
    again = quaternion_from_matrix(matrices)
    torch.testing.assert_close(matrix_from_quaternion(again), matrices, atol=1e-14, rtol=0)
    assert (again[..., 0] >= 0).all()
    torch.testing.assert_close(again.norm(dim=-1), torch.ones(len(again), dtype=torch.float64))


def test_the_product_of_quaternions_rotates_by_the_second_then_the_first():
    a, b = some_quaternions()[:100], some_quaternions()[100:]
    torch.testing.assert_close(
        matrix_from_quaternion(quaternion_product(a, b)), matrix_from_quaternion(a) @ matrix_from_quaternion(b)
    )


def test_the_nearest_rotation_of_a_rotation_is_itself_and_of_a_noisy_one_close_to_it():
    rotations = matrix_from_quaternion(some_quaternions())
    torch.testing.assert_close(nearest_rotation(rotations), rotations)
    noise = 1e-3 * torch.randn(200, 3, 3, generator=torch.Generator().manual_seed(1), dtype=torch.float64)
    nearest = nearest_rotation(rotations + noise)
    assert (nearest - rotations).abs().max() < 5e-3
    torch.testing.assert_close(nearest @ nearest.mT, torch.eye(3, dtype=torch.float64).expand_as(nearest))


def test_the_nearest_rotation_of_a_reflection_is_a_rotation():
    torch.testing.assert_close(
        torch.linalg.det(nearest_rotation(torch.diag(torch.tensor([1.0, 1, -1])))), torch.tensor(1.0)
    )


def test_a_covariance_has_the_squared_scales_along_its_axes():
    quaternions, scales = some_quaternions(5), torch.rand(5, 3, dtype=torch.float64) + 0.1
    axes = matrix_from_quaternion(quaternions)
    along = axes.mT @ covariance(quaternions, scales) @ axes
    torch.testing.assert_close(along, torch.diag_embed(scales**2))
