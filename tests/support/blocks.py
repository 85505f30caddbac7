"""A room of blocks that two cameras see: a floor, a wall at x = 4.02 and two chairs, with one Gaussian for each pixel."""

from __future__ import annotations

from dataclasses import replace

import torch
from wall_and_chair import pose

from semgs.data.tables.classes import SCANNET20
from semgs.geometry.cameras import Cameras
from semgs.geometry.gaussians import Appearance, Gaussians, move_cameras, move_gaussians
from semgs.scene.scene_file import SavedScene

BLOCKS = (
    ("floor", (-9.0, -9.0, -0.5), (9.0, 9.0, 0.0)),
    ("wall", (4.02, -9.0, -0.5), (4.5, 9.0, 9.0)),
    ("chair", (2.02, 0.32, 0.0), (2.48, 0.78, 0.78)),
    ("chair", (2.02, -0.98, 0.0), (2.48, -0.52, 0.78)),
)
"""Class and opposite corners of each block [m]. The first camera is in the middle between the chairs."""

SIZE = (60, 80)
EYES = ((0.0, 0.0, 1.2), (0.1, -0.2, 1.3))


def room_of_blocks(blocks=BLOCKS, unit: str = "metric", classes: bool = True) -> SavedScene:
    """The room, in a world with z up."""
    height, width = SIZE
    k = torch.tensor([[55.0, 0, 0.52 * width], [0, 55.0, 0.47 * height], [0, 0, 1]], dtype=torch.float64)
    poses = torch.stack([pose(yaw, eye, -20.0) for yaw, eye in zip((2.0, -3.0), EYES, strict=True)])
    cameras = Cameras(poses, k.expand(2, 3, 3), SIZE)
    rows, columns = torch.meshgrid(torch.arange(height) + 0.5, torch.arange(width) + 0.5, indexing="ij")
    pixels = torch.stack((columns, rows, torch.ones(SIZE)), -1).double()
    rays = pixels @ torch.linalg.inv(k).T @ poses[:, None, :3, :3].mT
    centres = cameras.centres[:, None, None]
    nearest = torch.full((2, *SIZE), 20.0, dtype=torch.float64)
    labels = torch.zeros(2, *SIZE, dtype=torch.long)
    for name, low, high in blocks:
        sides = torch.stack([(torch.tensor(corner) - centres) / rays for corner in (low, high)])
        enters, leaves = sides.amin(0).amax(-1), sides.amax(0).amin(-1)
        hit = (enters < leaves) & (enters > 0) & (enters < nearest)
        nearest = torch.where(hit, enters, nearest)
        labels = torch.where(hit, SCANNET20.index(name), labels)
    means = (centres + nearest[..., None] * rays).flatten(0, 2)
    features = torch.full((len(means), 20), 0.2 / 19)
    features[torch.arange(len(means)), labels.flatten()] = 0.8
    quaternions = torch.tensor([1.0, 0, 0, 0]).expand(len(means), 4)
    shape = Appearance(quaternions, torch.full((len(means), 3), 0.01), torch.zeros(len(means), 1, 3))
    semantic = replace(shape, features=features) if classes else None
    return SavedScene(
        gaussians=Gaussians(means.float(), torch.full((len(means),), 0.9), shape, semantic),
        cameras=cameras, depths=nearest.float(), confidences=torch.ones(2, *SIZE),
        depth_range=torch.tensor([0.3, 25.0], dtype=torch.float64).expand(2, 2), unit=unit, classes=SCANNET20 if classes else None,
        frames=("a", "b"), source="blocks", model="none",
    )  # fmt: skip


def turned(scene: SavedScene, matrix: torch.Tensor) -> SavedScene:
    """The scene in another frame."""
    return replace(
        scene, gaussians=move_gaussians(matrix, scene.gaussians), cameras=move_cameras(matrix, scene.cameras)
    )
