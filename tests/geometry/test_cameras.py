"""Cameras: one convention, and what they refuse."""

from __future__ import annotations

import math

import numpy as np
import pytest
import torch

from semgs.geometry.cameras import Cameras, back_project, inverse_rigid, pixel_centres, project
from semgs.geometry.rotations import matrix_from_quaternion

K = [[50.0, 0, 21.3], [0, 47.0, 13.1], [0, 0, 1]]
SIZE = (28, 41)


def pose(seed: int = 0) -> torch.Tensor:
    generator = torch.Generator().manual_seed(seed)
    matrix = torch.eye(4, dtype=torch.float64)
    matrix[:3, :3] = matrix_from_quaternion(torch.randn(4, generator=generator, dtype=torch.float64))
    matrix[:3, 3] = torch.randn(3, generator=generator, dtype=torch.float64) * 3
    return matrix


def test_a_point_straight_ahead_is_seen_at_the_principal_point():
    matrix = pose()
    ahead = matrix[:3, 3] + 2.5 * matrix[:3, 2]
    seen = project(ahead[None], Cameras(matrix, K, SIZE))
    torch.testing.assert_close(seen, torch.tensor([[21.3, 13.1, 2.5]], dtype=torch.float64))


def test_what_is_right_of_the_axis_is_right_in_the_picture_and_what_is_below_is_below():
    matrix = pose(1)
    point = matrix[:3, 3] + 2 * matrix[:3, 2] + 0.4 * matrix[:3, 0] + 0.2 * matrix[:3, 1]
    seen = project(point[None], Cameras(matrix, K, SIZE))[0]
    torch.testing.assert_close(seen[:2], torch.tensor([21.3 + 50 * 0.2, 13.1 + 47 * 0.1], dtype=torch.float64))


def test_projecting_what_was_back_projected_gives_pixel_centres_and_depths():
    cameras = Cameras(torch.stack((pose(2), pose(3))), [K, K], SIZE)
    depths = 1 + torch.rand(2, *SIZE, generator=torch.Generator().manual_seed(0), dtype=torch.float64)
    seen = project(back_project(depths, cameras).flatten(1, 2), cameras).unflatten(1, SIZE)
    torch.testing.assert_close(seen[..., 2], depths)
    torch.testing.assert_close(seen[..., :2], pixel_centres(SIZE).expand(2, *SIZE, 2))


def test_the_first_pixel_centre_is_at_one_half():
    assert pixel_centres(SIZE)[0, 0].tolist() == [0.5, 0.5]
    assert pixel_centres(SIZE)[3, 5].tolist() == [5.5, 3.5]


def test_a_rigid_motion_and_its_inverse_cancel():
    matrices = torch.stack([pose(seed) for seed in range(5)])
    torch.testing.assert_close(inverse_rigid(matrices) @ matrices, torch.eye(4, dtype=torch.float64).expand(5, 4, 4))


@pytest.mark.parametrize(
    "form", [lambda m: m.float(), lambda m: m.numpy().tolist(), lambda m: m.numpy().astype(np.float32)]
)
def test_whatever_comes_in_is_held_as_float64(form):
    cameras = Cameras(form(pose()), form(torch.tensor(K)), SIZE)
    assert cameras.world_from_camera.dtype == cameras.intrinsics.dtype == torch.float64
    assert (cameras.world_from_camera - pose()).abs().max() < 1e-6


def test_poses_that_are_nearly_rotations_are_orthonormalised():
    matrix = pose()
    matrix[:3, :3] += 1e-3 * torch.randn(3, 3, generator=torch.Generator().manual_seed(4), dtype=torch.float64)
    rotation = Cameras(matrix, K, SIZE).world_from_camera[:3, :3]
    assert (rotation @ rotation.mT - torch.eye(3, dtype=torch.float64)).abs().max() < 1e-12
    assert (rotation - matrix[:3, :3]).abs().max() < 5e-3


@pytest.mark.parametrize(
    ("scale", "kept"), [(0.908, False), (0.989, False), (0.991, True), (1.009, True), (1.011, False)]
)
def test_a_pose_may_be_a_hundredth_off_a_rotation_and_no_more(scale: float, kept: bool):
    """Of s R the nearest rotation is R; with elements of 1 in R, it is |s - 1| away."""
    matrix = pose()
    rotation = torch.tensor([[0.0, -1, 0], [0, 0, -1], [1, 0, 0]], dtype=torch.float64)
    matrix[:3, :3] = scale * rotation
    if kept:
        torch.testing.assert_close(Cameras(matrix, K, SIZE).world_from_camera[:3, :3], rotation)
    else:
        told = rf"more than 0\.01 from the nearest rotation \(it scales by {scale}\); divide each of its three columns by its length$"
        with pytest.raises(ValueError, match=told):
            Cameras(matrix, K, SIZE)


def test_leading_axes_are_free_and_can_be_indexed():
    matrices = torch.stack([pose(seed) for seed in range(6)]).unflatten(0, (2, 3))
    cameras = Cameras(matrices, torch.tensor(K).expand(2, 3, 3, 3), SIZE)
    assert cameras.batch == (2, 3)
    torch.testing.assert_close(cameras[1, 2].centres, matrices[1, 2, :3, 3])
    assert cameras.focal_px.shape == (2, 3, 2)


def changed(matrix: object, place: tuple[int, int], value: float) -> torch.Tensor:
    result = torch.as_tensor(matrix, dtype=torch.float64).clone()
    result[place] = value
    return result


@pytest.mark.parametrize(
    ("poses", "intrinsics", "size", "message"),
    [
        (changed(pose(), (1, 3), math.nan), K, SIZE, "not finite"),
        (changed(pose(), (0, 0), math.inf), K, SIZE, "not finite"),
        (changed(pose(), (3, 0), 1.0), K, SIZE, "last row"),
        (torch.diag(torch.tensor([1.0, 1, 0, 1])), K, SIZE, "not a rigid motion: .* determinant 0"),
        (torch.diag(torch.tensor([1.0, 1, -1, 1])), K, SIZE, "determinant -1"),
        (torch.diag(torch.tensor([2.0, 2, 2, 1])), K, SIZE, "determinant 8"),
        (pose(), changed(K, (0, 0), 0.0), SIZE, "fx = 0"),
        (pose(), changed(K, (1, 1), -47.0), SIZE, "fy = -47"),
        (pose(), changed(K, (0, 2), math.nan), SIZE, "not finite"),
        (pose(), changed(K, (2, 0), 1.0), SIZE, "is not"),
        (pose(), changed(K, (1, 0), 1.0), SIZE, "is not"),
        (pose()[:3], K, SIZE, "expected"),
        (pose()[None], K, SIZE, "equal leading axes"),
        (pose(), K, (0, 41), "two positive integers"),
        (pose(), K, (28, 41, 3), "two positive integers"),
        (pose(), K, (-28, 41), "two positive integers"),
    ],
)
def test_cameras_that_cannot_be_are_refused(poses, intrinsics, size, message):
    with pytest.raises(ValueError, match=message):
        Cameras(poses, intrinsics, size)


def test_the_error_names_the_camera_at_fault():
    bad = torch.stack((pose(0), pose(1), changed(pose(2), (0, 0), math.nan)))
    with pytest.raises(ValueError, match=r"world_from_camera\[2\]"):
        Cameras(bad, torch.tensor(K).expand(3, 3, 3), SIZE)


def test_depths_of_another_size_are_not_back_projected():
    with pytest.raises(ValueError, match="height, width"):
        back_project(torch.ones(SIZE[::-1]), Cameras(pose(), K, SIZE))
