"""Depth candidates and their expectation against loops, and the projective map of the sweep against a projection."""

from __future__ import annotations

import pytest
import torch
from posed import posed_cameras

from semgs.geometry.cameras import project
from semgs.geometry.plane_sweep import depth_candidates, expected_depth, sweep

BOUNDS = torch.tensor([[0.5, 8.0], [0.7, 3.0]], dtype=torch.float64)


def candidates_by_loop(near: float, far: float, count: int, sampling: str) -> list[float]:
    """From far to near in equal steps of 1 / depth, or of depth."""
    if sampling == "inverse":
        return [1 / (1 / far + k / (count - 1) * (1 / near - 1 / far)) for k in range(count)]
    return [far + k / (count - 1) * (near - far) for k in range(count)]


def expectation_by_loop(probabilities: list[float], depths: list[float], sampling: str) -> float:
    if sampling == "inverse":
        return 1 / sum(p / d for p, d in zip(probabilities, depths, strict=True))
    return sum(p * d for p, d in zip(probabilities, depths, strict=True))


@pytest.mark.parametrize("sampling", ["inverse", "linear"])
def test_candidates_run_from_far_to_near_in_equal_steps(sampling):
    found = depth_candidates(BOUNDS, 9, sampling)
    for row, (near, far) in zip(found.tolist(), BOUNDS.tolist(), strict=True):
        assert row == pytest.approx(candidates_by_loop(near, far, 9, sampling), rel=1e-12)
        assert (row[0], row[-1]) == pytest.approx((far, near), rel=1e-12)


@pytest.mark.parametrize("sampling", ["inverse", "linear"])
def test_depth_is_the_expectation_of_its_own_sampling_at_every_pixel(sampling):
    other = {"inverse": "linear", "linear": "inverse"}[sampling]
    generator = torch.Generator().manual_seed(1)
    p = (2 * torch.randn(2, 9, 3, 4, generator=generator, dtype=torch.float64)).softmax(1)
    candidates = depth_candidates(BOUNDS, 9, sampling)
    found = expected_depth(p, candidates, sampling)
    swapped = expected_depth(p, candidates, other)
    for view in range(2):
        for row in range(3):
            for column in range(4):
                pixel = p[view, :, row, column].tolist()
                expected = expectation_by_loop(pixel, candidates[view].tolist(), sampling)
                assert found[view, row, column].item() == pytest.approx(expected, rel=1e-12)
                assert swapped[view, row, column].item() != pytest.approx(expected, rel=1e-2)


def test_certainty_gives_the_candidate_itself():
    candidates = depth_candidates(BOUNDS, 5)
    p = torch.zeros(2, 5, 1, 1, dtype=torch.float64)
    p[:, 3] = 1
    for sampling in ("inverse", "linear"):
        assert torch.allclose(expected_depth(p, candidates, sampling)[:, 0, 0], candidates[:, 3])


@pytest.mark.parametrize("size", [(16, 28), (28, 16)])
def test_the_sweep_takes_a_texel_s_centre_to_where_the_source_camera_sees_it(size):
    cameras = posed_cameras(2, size, seed=3)
    grid = (size[0] // 4, size[1] // 4)
    plan = sweep(cameras[:1], cameras[1:], grid)
    reference = cameras.world_from_camera[0]
    for row, column, depth in ((0, 0, 1.3), (2, 3, 2.0), (grid[0] - 1, 1, 4.0)):
        pixel = torch.tensor([4 * (column + 0.5), 4 * (row + 0.5), 1], dtype=torch.float64)
        ray = torch.linalg.inv(cameras.intrinsics[0]) @ pixel
        point = reference[:3, :3] @ ray * depth + reference[:3, 3]
        x, y, z = project(point[None], cameras[1])[0].tolist()
        texel = torch.tensor([column, row, 1], dtype=torch.float64)
        u, v, w = (plan.matrix[0] @ texel * depth + plan.offset[0]).tolist()
        assert (u / w, v / w, w) == pytest.approx((x / 4 - 0.5, y / 4 - 0.5, z), rel=1e-10)
