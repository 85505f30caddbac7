"""A walk along a wall without a trained network: cameras that look at the plane z = 4 m, and a network that knows it."""

from __future__ import annotations

from collections.abc import Sequence

import torch
from torch import Tensor

from semgs.data.tables.classes import ClassTable
from semgs.data.views import Views
from semgs.geometry.cameras import Cameras, back_project
from semgs.geometry.gaussians import Appearance, Gaussians
from semgs.scene.encoding import Encoding

SIZE = (12, 18)
WALL = 4.0
INTRINSICS = torch.tensor([[16.0, 0, 8.3], [0, 16, 5.6], [0, 0, 1]], dtype=torch.float64)
TABLE = ClassTable("three", ("wall", "floor", "chair"), ((1, 2, 3), (4, 5, 6), (7, 8, 9)), (1, 2, 3))


def pose(x: float, y: float = 0.0, z: float = 0.0, yaw: float = 0.0) -> Tensor:
    """A camera at a place, turned to the right by `yaw` [rad]."""
    turn, place = torch.tensor(yaw).double(), torch.tensor([x, y, z], dtype=torch.float64)
    found = torch.eye(4, dtype=torch.float64)
    found[0, 0], found[0, 2], found[2, 0], found[2, 2] = turn.cos(), turn.sin(), -turn.sin(), turn.cos()
    found[:3, 3] = place
    return found


def cameras_at(*places: float, size: tuple[int, int] = SIZE) -> Cameras:
    """Cameras at these places along x, that look straight at the wall."""
    return Cameras(torch.stack([pose(x) for x in places]), INTRINSICS.repeat(len(places), 1, 1), size)


def seen_at(cameras: Cameras, images: Tensor | None = None) -> Views:
    """What cameras see: these images, or grey."""
    grey = torch.full((len(cameras.world_from_camera), 3, *SIZE), 0.5)
    return Views(grey if images is None else images, cameras, [[0.5, 10.0]] * len(grey))


def encoded(
    cameras: Cameras, depths: Tensor, spread: float | Tensor = 0.01, classes: Sequence[float] | Tensor = (0.8, 0.1, 0.1)
) -> Encoding:
    """Gaussians at these depths, one for each pixel."""
    means = back_project(depths.double(), cameras).reshape(-1, 3).float()
    turns = torch.tensor([0.8, 0.0, 0.6, 0.0]).expand(len(means), 4)
    scales = torch.full((len(means), 3), 0.1)
    colour = Appearance(turns, scales, torch.zeros(len(means), 1, 3))
    shares = torch.as_tensor(classes).float().expand(len(means), 3)
    spreads = torch.as_tensor(spread).float().expand(depths.shape).clone()
    bounds = torch.tensor([[0.5, 10.0]] * len(depths), dtype=torch.float64)
    gaussians = Gaussians(means, torch.full((len(means),), 0.6), colour, Appearance(turns, scales, shares))
    return Encoding(gaussians, depths.float(), torch.full_like(spreads, 0.5), spreads, bounds, TABLE)


class KnowsTheWall:
    """A network that sees the plane z = `WALL`.

    Attributes:
        windows: how many views each window had.
    """

    name, classes = "wall", TABLE

    def __init__(self) -> None:
        self.windows: list[int] = []

    def __call__(self, views: Views) -> Encoding:
        """One Gaussian for each pixel, on the wall."""
        self.windows.append(len(views))
        ones = torch.ones(len(views), *views.size, dtype=torch.float64)
        ahead = back_project(ones, views.cameras)[..., 2] - views.cameras.centres[:, None, None, 2]
        depths = (WALL - views.cameras.centres[:, None, None, 2]) / ahead
        return encoded(views.cameras, depths)


def image(brightness: float = 0.5, size: tuple[int, int] = SIZE) -> Tensor:
    """An image that gets brighter to the right, [3 h w]."""
    return (brightness * torch.linspace(0.3, 1.0, size[1])).expand(3, *size).clone()
