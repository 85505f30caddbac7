"""A scene of two cameras that look at a wall and a chair, with as many Gaussians as a test needs."""

from __future__ import annotations

from math import cos, radians, sin

import torch

from semgs.data.tables.classes import SCANNET20
from semgs.geometry.cameras import Cameras, back_project
from semgs.geometry.gaussians import Appearance, Gaussians
from semgs.geometry.rotations import quaternion_from_matrix
from semgs.scene.scene_file import SavedScene

WALL, CHAIR = SCANNET20.names.index("wall"), SCANNET20.names.index("chair")
RED, GREEN = (0.9, 0.1, 0.1), (0.1, 0.7, 0.2)


def pose(yaw: float, position: tuple[float, float, float], pitch: float = -12.0) -> torch.Tensor:
    """World (z up) from a level camera; yaw from x towards y, pitch above the horizon [degrees]."""
    a, p = radians(yaw), radians(pitch)
    forward = torch.tensor([cos(a) * cos(p), sin(a) * cos(p), sin(p)], dtype=torch.float64)
    right = torch.tensor([sin(a), -cos(a), 0.0], dtype=torch.float64)
    world_from_camera = torch.eye(4, dtype=torch.float64)
    world_from_camera[:3, :3] = torch.stack((right, torch.linalg.cross(forward, right), forward), 1)
    world_from_camera[:3, 3] = torch.tensor(position)
    return world_from_camera


def wall_and_chair(size: tuple[int, int] = (40, 50), scale: float = 1.0, classes: bool = True) -> SavedScene:
    """A Gaussian for each pixel of two cameras: in their left 60 % a red wall at 2.5 m, in the rest a green chair at 2 m.

    Args:
        size: (height, width) of each camera [px].
        scale: of the world: 0.001 makes a room of millimetres.
        classes: whether there are any.
    """
    height, width = size
    k = torch.tensor([[0.9 * width, 0, 0.52 * width], [0, 0.9 * width, 0.47 * height], [0, 0, 1]], dtype=torch.float64)
    poses = torch.stack((pose(30.0, (1.0, 2.0, 1.5)), pose(25.0, (1.2, 1.9, 1.4))))
    cameras = Cameras(poses, k.expand(2, 3, 3), size)
    is_wall = (torch.arange(width) < 0.6 * width).expand(2, height, width)
    depths = torch.where(is_wall, 2.5, 2.0).double()
    means = back_project(depths, cameras).flatten(0, 2)
    count, wall = len(means), is_wall.flatten()
    colours = torch.where(wall[:, None], torch.tensor(RED), torch.tensor(GREEN))
    quaternions = quaternion_from_matrix(poses[:, :3, :3]).repeat_interleave(height * width, 0).float()
    side = (depths.flatten() / (0.9 * width))[:, None].float()

    def shape(features: torch.Tensor, wide: float) -> Appearance:
        return Appearance(quaternions, scale * side * torch.tensor([wide, wide, 0.2]), features)

    features = torch.full((count, len(SCANNET20)), 0.2 / (len(SCANNET20) - 1))
    features[torch.arange(count), torch.where(wall, WALL, CHAIR)] = 0.8
    scaled = poses.clone()
    scaled[:, :3, 3] *= scale
    return SavedScene(
        gaussians=Gaussians(
            means=(scale * means).float(),
            opacities=torch.linspace(0.7, 0.95, count),
            colour=shape(((colours - 0.5) / 0.28209479)[:, None], 0.7),
            semantic=shape(features, 0.9) if classes else None,
        ),
        cameras=Cameras(scaled, k.expand(2, 3, 3), size),
        depths=scale * depths.float(),
        confidences=torch.linspace(0.4, 0.9, count).reshape(2, height, width),
        depth_range=scale * torch.tensor([[0.5, 9.0]], dtype=torch.float64).expand(2, 2),
        unit="metric",
        classes=SCANNET20 if classes else None,
        frames=("a/left.jpg", "b.jpg"),
        source="wall & chair",
        model="none",
        origin=(100.0, -20.0, 3.0),
    )
