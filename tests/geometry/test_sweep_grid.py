"""The sweep by hand: candidates, what is expected of them, and the map between texels that are no squares."""

from __future__ import annotations

import pytest
import torch
from posed import posed_cameras

from semgs.geometry.cameras import project
from semgs.geometry.plane_sweep import depth_candidates, expected_depth, sweep

SIZE, GRID = (32, 48), (8, 24)


def test_a_texel_goes_to_the_texel_that_its_point_is_seen_in() -> None:
    cameras = posed_cameras(2, SIZE, seed=3)
    plan = sweep(cameras[0], cameras[1], GRID)
    height, width = SIZE
    for column, row, depth in ((3, 2, 1.5), (20, 6, 4.0), (11, 0, 2.5)):
        pixel = torch.tensor([(column + 0.5) * width / GRID[1], (row + 0.5) * height / GRID[0], 1.0]).double()
        pose = cameras.world_from_camera[0]
        world = pose[:3, :3] @ (torch.linalg.inv(cameras.intrinsics[0]) @ pixel * depth) + pose[:3, 3]
        x, y, z = project(world[None], cameras[1])[0]
        found = plan.matrix @ torch.tensor([column, row, 1.0], dtype=torch.float64) * depth + plan.offset
        expected = torch.stack((x * GRID[1] / width - 0.5, y * GRID[0] / height - 0.5, torch.ones_like(z))) * z
        torch.testing.assert_close(found, expected)


@pytest.mark.parametrize(
    ("sampling", "candidates", "expected"),
    [
        ("inverse", [8.0, 1 / 0.75, 1 / 1.375, 0.5], 1 / (0.1 / 8 + 0.2 * 0.75 + 0.3 * 1.375 + 0.4 / 0.5)),
        ("linear", [8.0, 5.5, 3.0, 0.5], 0.1 * 8 + 0.2 * 5.5 + 0.3 * 3 + 0.4 * 0.5),
    ],
)
def test_candidates_run_from_far_to_near_and_depth_is_expected_as_they_are_spaced(
    sampling, candidates: list[float], expected: float
) -> None:
    found = depth_candidates(torch.tensor([0.5, 8.0], dtype=torch.float64), 4, sampling)
    assert found.tolist() == pytest.approx(candidates, rel=1e-12)
    probabilities = torch.tensor([0.1, 0.2, 0.3, 0.4], dtype=torch.float64)[:, None, None]
    assert expected_depth(probabilities, found, sampling).item() == pytest.approx(expected, rel=1e-12)
