"""A small scene that two turned cameras see: a tilted plane, with a colour and class for every pixel."""

from __future__ import annotations

from dataclasses import replace
from math import cos, sin

import torch

from semgs.data.tables.classes import SCANNET20
from semgs.geometry.cameras import Cameras, back_project
from semgs.geometry.gaussians import Appearance, Gaussians
from semgs.scene.scene_file import SavedScene

SIZE = (20, 28)
WALL, CHAIR, TABLE = (SCANNET20.names.index(name) for name in ("wall", "chair", "table"))


def plane_scene(classes: bool = True, origin: tuple[float, float, float] = (0.0, 0.0, 0.0)) -> SavedScene:
    """The plane z = 3 + 0.2 x of the first camera's frame, in a turned world. Classes change from left to right: wall, chair, table."""
    draw = torch.Generator().manual_seed(4)
    world_from_first = torch.eye(4, dtype=torch.float64)
    a, b = 0.7, -1.9
    world_from_first[:3, :3] = torch.tensor([[cos(a), -sin(a), 0], [sin(a), cos(a), 0], [0, 0, 1]]).double() @ torch.tensor(
        [[1, 0, 0], [0, cos(b), -sin(b)], [0, sin(b), cos(b)]]
    ).double()  # fmt: skip
    world_from_first[:3, 3] = torch.tensor([2.0, -1.0, 0.5])
    first_from_second = torch.eye(4, dtype=torch.float64)
    first_from_second[:3, :3] = torch.tensor([[cos(0.1), 0, sin(0.1)], [0, 1, 0], [-sin(0.1), 0, cos(0.1)]])
    first_from_second[:3, 3] = torch.tensor([-0.3, 0.05, 0.02])
    inside = torch.stack((torch.eye(4, dtype=torch.float64), first_from_second))
    k = torch.tensor([[26.0, 0, 13.2], [0, 24, 10.7], [0, 0, 1]], dtype=torch.float64)
    cameras = Cameras(world_from_first @ inside, k.expand(2, 3, 3), SIZE)
    rays = back_project(torch.ones(2, *SIZE, dtype=torch.float64), Cameras(inside, k.expand(2, 3, 3), SIZE))
    rays = rays - inside[:, None, None, :3, 3]
    centres = inside[:, :3, 3][:, None, None]
    depths = (3 + 0.2 * centres[..., 0] - centres[..., 2]) / (rays[..., 2] - 0.2 * rays[..., 0])
    means = back_project(depths, cameras).reshape(-1, 3)
    count = len(means)

    def shape(features: torch.Tensor) -> Appearance:
        quaternions = torch.nn.functional.normalize(torch.randn(count, 4, generator=draw), dim=-1)
        return Appearance(quaternions, torch.rand(count, 3, generator=draw) * 0.05 + 0.01, features)

    column = torch.arange(SIZE[1]).expand(2, *SIZE).reshape(-1)
    numbers = torch.tensor([WALL, CHAIR, TABLE])[(3 * column / SIZE[1]).long()]
    shares = torch.full((count, 20), 0.2 / 19).scatter(1, numbers[:, None], 0.8)
    gaussians = Gaussians(
        means=means.float(),
        opacities=0.2 + 0.7 * torch.rand(count, generator=draw),
        colour=shape(0.2 * torch.randn(count, 9, 3, generator=draw)),
        semantic=shape(shares) if classes else None,
    )
    scene = SavedScene(
        gaussians=gaussians, cameras=cameras, depths=depths.float(), confidences=torch.full((2, *SIZE), 0.75),
        depth_range=torch.tensor([0.5, 9.0], dtype=torch.float64).expand(2, 2), unit="metric",
        classes=SCANNET20 if classes else None, frames=("images/b.jpg", "images/a.jpg"), source="plane", model="none",
    )  # fmt: skip
    return replace(scene, origin=origin)
