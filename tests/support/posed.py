"""Posed views to test with: never square, never the identity, never a central principal point."""

from __future__ import annotations

import torch

from semgs.data.views import Views
from semgs.geometry.cameras import Cameras
from semgs.geometry.rotations import matrix_from_quaternion


def posed_cameras(views: int, size: tuple[int, int], seed: int = 0, spread: float = 0.3) -> Cameras:
    """Cameras side by side that look the same way but for a few degrees, each with its own K."""
    generator = torch.Generator().manual_seed(seed)

    def draw(*shape: int) -> torch.Tensor:
        return torch.rand(*shape, generator=generator, dtype=torch.float64) * 2 - 1

    world = matrix_from_quaternion(torch.tensor([0.8, 0.3, -0.5, 0.2], dtype=torch.float64))
    small = matrix_from_quaternion(torch.cat((torch.ones(views, 1, dtype=torch.float64), 0.04 * draw(views, 3)), dim=1))
    poses = torch.eye(4, dtype=torch.float64).repeat(views, 1, 1)
    poses[:, :3, :3] = world @ small
    poses[:, :3, 3] = torch.tensor([0.7, -1.1, 2.0]) + spread * (
        draw(views, 3) + torch.arange(views)[:, None] * world[:, 0]
    )
    height, width = size
    k = torch.eye(3, dtype=torch.float64).repeat(views, 1, 1)
    k[:, 0, 0] = width * (0.9 + 0.1 * draw(views))
    k[:, 1, 1] = width * (1.1 + 0.1 * draw(views))
    k[:, 0, 2] = width * (0.46 + 0.03 * draw(views))
    k[:, 1, 2] = height * (0.55 + 0.03 * draw(views))
    return Cameras(poses, k, size)


def posed_views(views: int, size: tuple[int, int], seed: int = 0, dtype: torch.dtype = torch.float32) -> Views:
    """Such cameras with random smooth pictures, near 0.5 and far 10."""
    generator = torch.Generator().manual_seed(seed + 1)
    coarse = torch.rand(views, 3, 7, 9, generator=generator, dtype=torch.float64)
    images = torch.nn.functional.interpolate(coarse, size, mode="bilinear", align_corners=False).clamp(0, 1).to(dtype)
    bounds = torch.tensor([0.5, 10.0], dtype=torch.float64).expand(views, 2)
    return Views(images, posed_cameras(views, size, seed), bounds)
