"""Fusion of what several views say, against a loop over points and by hand."""

from __future__ import annotations

import math

import pytest
import torch

from semgs.geometry.cameras import Cameras
from semgs.geometry.fusion import LEAST, SPREAD, TOLERANCE, fuse_classes

SIZE = (6, 9)


def side_by_side(*places: float) -> Cameras:
    """Cameras that look the same way at these places along x [m]; focal length 8 px, the centre off the middle."""
    poses = torch.eye(4, dtype=torch.float64).repeat(len(places), 1, 1)
    poses[:, 0, 3] = torch.tensor(places, dtype=torch.float64)
    intrinsics = torch.tensor([[8.0, 0, 4.3], [0, 8, 2.6], [0, 0, 1]], dtype=torch.float64)
    return Cameras(poses, intrinsics.repeat(len(places), 1, 1), SIZE)


def told(*distributions: tuple[float, ...]) -> torch.Tensor:
    """Views that say the same of every pixel."""
    return torch.tensor(distributions, dtype=torch.float64)[:, :, None, None].expand(-1, -1, *SIZE)


def test_two_views_of_a_wall_are_pooled_where_both_see_it():
    """At 4 m and 1 m apart the second view's pixels are two columns to the left: the first two columns of view 0 are its own alone."""
    cameras = side_by_side(0.0, 1.0)
    depths, spread = torch.full((2, *SIZE), 4.0).double(), torch.full((2, *SIZE), 0.01).double()
    found = fuse_classes(told((0.9, 0.1), (0.4, 0.6)), depths, spread, cameras)
    a, b = (math.sqrt((x + LEAST) * (y + LEAST)) for x, y in ((0.9, 0.4), (0.1, 0.6)))
    pooled = a / (a + b)
    alone = (0.9 + LEAST) / (1 + 2 * LEAST)
    torch.testing.assert_close(found[0, 0, :, 2:], torch.full((6, 7), pooled, dtype=torch.float64), rtol=0, atol=1e-9)
    torch.testing.assert_close(found[0, 0, :, :2], torch.full((6, 2), alone, dtype=torch.float64), rtol=0, atol=1e-9)
    torch.testing.assert_close(found[1, 0, :, :7], torch.full((6, 7), pooled, dtype=torch.float64), rtol=0, atol=1e-9)
    torch.testing.assert_close(found.sum(1), torch.ones(2, *SIZE).double())


@pytest.mark.parametrize(("ratio", "agrees"), [(1.09, True), (1.13, False)])
def test_a_view_counts_if_depths_agree_within_two_standard_deviations(ratio, agrees):
    """0.018 and 0.024 are 0.03 together, and 0.05 with the 0.02 for sampling: twice that is 0.10 in log depth, a factor of 1.105."""
    cameras = side_by_side(0.0, 0.0)
    depths = torch.stack((torch.full(SIZE, 4.0), torch.full(SIZE, 4.0 * ratio))).double()
    spread = torch.stack((torch.full(SIZE, 0.018), torch.full(SIZE, 0.024))).double()
    assert (SPREAD, TOLERANCE) == (0.02, 2.0)
    found = fuse_classes(told((0.9, 0.1), (0.2, 0.8)), depths, spread, cameras)
    assert (found[0, 0].max() < 0.85) == agrees


def test_fusion_equals_a_loop_over_points_and_views():
    generator = torch.Generator().manual_seed(4)
    poses = torch.eye(4, dtype=torch.float64).repeat(3, 1, 1)
    for view, angle in enumerate((0.0, 0.08, -0.11)):
        poses[view, :3, :3] = torch.linalg.matrix_exp(
            torch.tensor([[0, -0.3, 1.0], [0.3, 0, 0.2], [-1.0, -0.2, 0]], dtype=torch.float64) * angle
        )
        poses[view, :3, 3] = torch.tensor([0.3 * view, -0.2 * view, 0.15 * view])
    cameras = Cameras(poses, side_by_side(0, 0, 0).intrinsics, SIZE)
    say = torch.rand((3, 4, *SIZE), generator=generator).double().softmax(1)
    depths = 3 + torch.rand((3, *SIZE), generator=generator).double()
    spread = 0.02 + 0.06 * torch.rand((3, *SIZE), generator=generator).double()
    votes = 0
    expected = torch.zeros_like(say)
    for i in range(3):
        for row in range(SIZE[0]):
            for column in range(SIZE[1]):
                logs, weight = (say[i, :, row, column] + LEAST).log(), 1
                ray = torch.linalg.inv(cameras.intrinsics[i]) @ torch.tensor([column + 0.5, row + 0.5, 1]).double()
                point = poses[i, :3, :3] @ ray * depths[i, row, column] + poses[i, :3, 3]
                for j in set(range(3)) - {i}:
                    x, y, z = cameras.intrinsics[j] @ poses[j, :3, :3].T @ (point - poses[j, :3, 3])
                    u, v = float(x / z), float(y / z)
                    if z <= 0 or not (0 <= u < SIZE[1] and 0 <= v < SIZE[0]):
                        continue
                    at = (j, int(v), int(u))
                    sigma = math.hypot(spread[i, row, column], spread[at]) + SPREAD
                    if abs(math.log(z / depths[at])) <= TOLERANCE * sigma:
                        logs, weight, votes = logs + (say[j, :, at[1], at[2]] + LEAST).log(), weight + 1, votes + 1
                expected[i, :, row, column] = (logs / weight).softmax(0)
    assert 40 < votes < 3 * 54 * 2 - 40, "some agree and some do not"
    torch.testing.assert_close(fuse_classes(say, depths, spread, cameras), expected, rtol=0, atol=1e-12)
