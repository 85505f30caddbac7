"""The sweep's map on feature maps whose texels are no squares: columns scale by width, rows by height."""

from __future__ import annotations

import torch
from posed import posed_cameras

from semgs.geometry.cameras import project
from semgs.geometry.plane_sweep import sweep

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
