"""A saved scene without a network: two views of a wall, with a Gaussian for each pixel."""

from __future__ import annotations

import torch
from posed import posed_cameras

from semgs.data.tables.classes import SCANNET20
from semgs.geometry.cameras import back_project
from semgs.geometry.gaussians import Appearance, Gaussians
from semgs.rendering.temperatures import Temperatures
from semgs.scene.scene_file import SavedScene

SIZE = (30, 41)
WALL, CHAIR = SCANNET20.index("wall"), SCANNET20.index("chair")
Z00 = 0.28209479177387814


def wall(classes: bool = True, temperatures: Temperatures | None = None, origin: float = 0.0) -> SavedScene:
    """2 m away, red from left to right and green from top to bottom; its left half is wall (0.81), its right half chair (0.62)."""
    cameras = posed_cameras(2, SIZE)
    depths = torch.full((2, *SIZE), 2.0)
    means = back_project(depths.double(), cameras).reshape(-1, 3).float()
    rows, columns = (torch.linspace(0.1, 0.9, side) for side in SIZE)
    image = torch.stack((columns.expand(SIZE), rows[:, None].expand(SIZE), torch.full(SIZE, 0.4)), -1)
    colours = (image.reshape(-1, 1, 3).repeat(2, 1, 1) - 0.5) / Z00
    turns = torch.tensor([0.8, 0.0, 0.6, 0.0]).expand(len(means), 4)
    shape = Appearance(turns, torch.full((len(means), 3), 0.03), colours)
    shares = torch.full((*SIZE, 20), 0.01)
    shares[:, : SIZE[1] // 2, WALL] = 0.81
    shares[:, SIZE[1] // 2 :] = 0.02
    shares[:, SIZE[1] // 2 :, CHAIR] = 0.62
    semantic = Appearance(turns, shape.scales, shares.reshape(-1, 20).repeat(2, 1))
    return SavedScene(
        gaussians=Gaussians(means, torch.full((len(means),), 0.9), shape, semantic if classes else None),
        cameras=cameras,
        depths=depths,
        confidences=torch.full_like(depths, 0.5),
        depth_spread=torch.full_like(depths, 0.1),
        depth_range=torch.tensor([[0.5, 10.0]] * 2, dtype=torch.float64),
        unit="metric",
        classes=SCANNET20 if classes else None,
        frames=("a.jpg", "b.jpg"),
        source="wall",
        model="small",
        temperatures=temperatures,
        origin=(origin, 0.0, 0.0),
    )
