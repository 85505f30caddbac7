"""Turning harmonics: a turned Gaussian shows to a turned eye what it showed before."""

from __future__ import annotations

import pytest
import torch

from semgs.geometry.harmonics import basis, rotate_harmonics
from semgs.geometry.rotations import matrix_from_quaternion


def seen(harmonics: torch.Tensor, directions: torch.Tensor) -> torch.Tensor:
    """The function of the coefficients [k 3] at directions [d 3]."""
    degree = round(harmonics.shape[-2] ** 0.5) - 1
    return basis(directions, degree) @ harmonics


@pytest.mark.parametrize("count", [1, 4, 9, 16])
def test_a_turned_colour_function_seen_from_a_turned_direction_is_the_same(count: int) -> None:
    generator = torch.Generator().manual_seed(count)
    harmonics = torch.randn(2, 5, count, 3, generator=generator, dtype=torch.float64)
    rotations = matrix_from_quaternion(torch.randn(2, 4, generator=generator, dtype=torch.float64))
    directions = torch.nn.functional.normalize(torch.randn(7, 3, generator=generator, dtype=torch.float64), dim=-1)
    turned = rotate_harmonics(harmonics, rotations)
    for camera in range(2):
        for gaussian in range(5):
            here = seen(harmonics[camera, gaussian], directions)
            there = seen(turned[camera, gaussian], directions @ rotations[camera].mT)
            torch.testing.assert_close(there, here, rtol=0, atol=1e-10)


def test_turning_twice_is_turning_by_the_product() -> None:
    generator = torch.Generator().manual_seed(0)
    harmonics = torch.randn(1, 3, 16, 3, generator=generator, dtype=torch.float64)
    first, second = matrix_from_quaternion(torch.randn(2, 1, 4, generator=generator, dtype=torch.float64))
    twice = rotate_harmonics(rotate_harmonics(harmonics, first), second)
    torch.testing.assert_close(twice, rotate_harmonics(harmonics, second @ first), rtol=0, atol=1e-10)


def test_the_dtype_of_the_harmonics_stays() -> None:
    harmonics = torch.randn(1, 2, 4, 3, generator=torch.Generator().manual_seed(1))
    turned = rotate_harmonics(harmonics, torch.eye(3)[None])
    assert turned.dtype == torch.float32
    torch.testing.assert_close(turned, harmonics)
