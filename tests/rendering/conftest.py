"""Random scenes that meet every rule: Gaussians in front, behind and beside, thin and broad, faint and opaque."""

from __future__ import annotations

from collections.abc import Callable

import pytest
import torch

from semgs.geometry.cameras import Cameras
from semgs.geometry.gaussians import Appearance, Gaussians
from semgs.geometry.rotations import matrix_from_quaternion


@pytest.fixture
def random_scene() -> Callable[..., tuple[Gaussians, Cameras]]:
    """A function (seed, count, views, size, harmonics, classes, batch) -> Gaussians and Cameras, float64."""
    return scene


@pytest.fixture
def random_cameras() -> Callable[..., Cameras]:
    """A function (generator, views, size, batch) -> Cameras that look roughly along z."""
    return cameras


def scene(
    seed: int = 0,
    count: int = 150,
    views: int = 2,
    size: tuple[int, int] = (37, 53),
    harmonics: int = 16,
    classes: int = 5,
    batch: tuple[int, ...] = (),
) -> tuple[Gaussians, Cameras]:
    generator = torch.Generator().manual_seed(seed)

    def uniform(*shape: int) -> torch.Tensor:
        return torch.rand(*batch, count, *shape, generator=generator, dtype=torch.float64)

    def normal(*shape: int) -> torch.Tensor:
        return torch.randn(*batch, count, *shape, generator=generator, dtype=torch.float64)

    reach = torch.tensor([2.2, 1.6, 3.5], dtype=torch.float64)
    means = (2 * uniform(3) - 1) * reach + torch.tensor([0.0, 0.0, 2.5], dtype=torch.float64)
    colour = Appearance(normal(4), 0.01 + 0.2 * uniform(3) ** 2, 0.4 * normal(harmonics, 3))
    semantic = Appearance(normal(4), 0.01 + 0.3 * uniform(3) ** 2, torch.softmax(2 * normal(classes), -1))
    return Gaussians(means, uniform(), colour, semantic), cameras(generator, views, size, batch)


def cameras(
    generator: torch.Generator, views: int = 2, size: tuple[int, int] = (37, 53), batch: tuple[int, ...] = ()
) -> Cameras:
    shape = (*batch, views)
    quaternions = 0.08 * torch.randn(*shape, 4, generator=generator, dtype=torch.float64)
    quaternions[..., 0] += 1
    poses = torch.eye(4, dtype=torch.float64).repeat(*shape, 1, 1)
    poses[..., :3, :3] = matrix_from_quaternion(quaternions)
    poses[..., :3, 3] = 0.2 * torch.randn(*shape, 3, generator=generator, dtype=torch.float64)
    height, width = size
    part = torch.rand(*shape, 4, generator=generator, dtype=torch.float64)
    intrinsics = torch.zeros(*shape, 3, 3, dtype=torch.float64)
    intrinsics[..., 0, 0] = width * (0.8 + 0.2 * part[..., 0])
    intrinsics[..., 1, 1] = width * (0.7 + 0.2 * part[..., 1])
    intrinsics[..., 0, 2] = width * (0.4 + 0.15 * part[..., 2])
    intrinsics[..., 1, 2] = height * (0.45 + 0.15 * part[..., 3])
    intrinsics[..., 2, 2] = 1
    return Cameras(poses, intrinsics, size)
