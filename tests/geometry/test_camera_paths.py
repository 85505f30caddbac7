"""Camera paths, by hand."""

from __future__ import annotations

import math

import pytest
import torch
from posed import posed_cameras

from semgs.geometry.camera_paths import interpolate_cameras, orbit, resize_cameras
from semgs.geometry.cameras import Cameras, project

PIVOT = torch.tensor([1.0, 2, 3], dtype=torch.float64)
UP = torch.tensor([0.0, 0, 1], dtype=torch.float64)


def camera() -> Cameras:
    """At (3, 2, 3.5), looking along -x, with +z up: x right is +y."""
    pose = torch.tensor([[0.0, 0, -1, 3], [1, 0, 0, 2], [0, -1, 0, 3.5], [0, 0, 0, 1]], dtype=torch.float64)
    return Cameras(pose, [[50.0, 0, 31], [0, 52, 19], [0, 0, 1]], (40, 60))


def test_a_full_circle_visits_the_four_sides_of_the_pivot_at_the_same_height_and_looks_inwards() -> None:
    found = orbit(camera(), PIVOT, UP, 360.0, 4)
    expected = torch.tensor([[3, 2, 3.5], [1, 4, 3.5], [-1, 2, 3.5], [1, 0, 3.5]], dtype=torch.float64)
    torch.testing.assert_close(found.centres, expected)
    forward = torch.tensor([[-1, 0, 0], [0, -1, 0], [1, 0, 0], [0, 1, 0]], dtype=torch.float64)
    torch.testing.assert_close(found.world_from_camera[:, :3, 2], forward)
    torch.testing.assert_close(found.world_from_camera[:, :3, 1], -UP.expand(4, 3))
    assert torch.equal(found.intrinsics, camera().intrinsics.expand(4, 3, 3))
    assert found.size == (40, 60)


def test_a_swing_of_60_degrees_goes_to_30_on_both_sides_and_starts_in_the_middle() -> None:
    found = orbit(camera(), PIVOT, UP, 60.0, 4)
    x, y = 1 + 2 * math.cos(math.pi / 6), 2 * math.sin(math.pi / 6)
    expected = torch.tensor([[3, 2, 3.5], [x, 2 + y, 3.5], [3, 2, 3.5], [x, 2 - y, 3.5]], dtype=torch.float64)
    torch.testing.assert_close(found.centres, expected)


def test_the_path_between_cameras_visits_each_there_and_back_and_rests_at_the_ends() -> None:
    cameras = posed_cameras(3, (30, 41))
    found = interpolate_cameras(cameras, 4)
    visited = [0, 1, 2, 1]
    torch.testing.assert_close(found.world_from_camera, cameras.world_from_camera[visited], rtol=0, atol=1e-12)
    torch.testing.assert_close(found.intrinsics, cameras.intrinsics[visited])
    steps = (interpolate_cameras(cameras, 400).centres.diff(dim=0)).norm(dim=-1)
    assert steps[0] < steps.max() / 50
    assert steps[199] < steps.max() / 50
    assert steps.max() < 4 * steps.mean()


def test_half_way_between_two_cameras_all_is_the_mean_and_poses_stay_rigid() -> None:
    cameras = posed_cameras(2, (30, 41))
    found = interpolate_cameras(cameras, 4)[1]
    torch.testing.assert_close(found.centres, cameras.centres.mean(0))
    torch.testing.assert_close(found.intrinsics, cameras.intrinsics.mean(0))
    rotation, (first, last) = found.world_from_camera[:3, :3], cameras.world_from_camera[:, :3, :3]
    torch.testing.assert_close(rotation @ rotation.T, torch.eye(3, dtype=torch.float64))
    torch.testing.assert_close(first.T @ rotation, rotation.T @ last)  # the same turn again leads to the last


def test_another_size_keeps_the_height_of_the_view_and_its_middle() -> None:
    """Twice the height doubles all lengths; of the then 120 columns, 10 are missing on either side."""
    point = torch.tensor([[1.0, 2.3, 3.1]], dtype=torch.float64)
    x, y, depth = project(point, camera())[0].tolist()
    assert project(point, resize_cameras(camera(), (80, 100)))[0].tolist() == pytest.approx([2 * x - 10, 2 * y, depth])
    assert resize_cameras(camera(), (80, 100)).size == (80, 100)
