"""A textured wall as a scene on disk, whose every pixel is known, and a network that knows its depth."""

from __future__ import annotations

import json
from collections.abc import Callable, Sequence
from pathlib import Path

import numpy as np
import pytest
import torch
from torch import nn

from semgs.data.scene import Scene
from semgs.data.scenes import open_scene
from semgs.data.tables.classes import SCANNET20, ClassTable
from semgs.data.views import Views
from semgs.files.images.pictures import write_png
from semgs.geometry.cameras import Cameras, back_project, pixel_centres
from semgs.geometry.gaussians import Appearance, Gaussians
from semgs.geometry.rotations import matrix_from_quaternion
from semgs.scene.encoding import Encoding

SIZE = (40, 56)
INTRINSICS = np.array([[52.0, 0, 27.0], [0, 50.0, 21.5], [0, 0, 1]])
TURN = matrix_from_quaternion(torch.tensor([0.9, 0.1, -0.3, 0.2], dtype=torch.float64)).numpy()
WALL = 2.0
"""Distance of the wall from the first camera [m]."""


def wall_camera(shift: float) -> Cameras:
    """A camera `shift` metres along a turned x axis, looking at the wall squarely, somewhere in the world."""
    pose = np.eye(4)
    pose[:3, :3] = TURN
    pose[:3, 3] = TURN @ [shift, -0.3 * shift, 0.1 * shift] + [3.0, -1.0, 0.5]
    return Cameras(pose, INTRINSICS, SIZE)


def look(shift: float) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """What that camera sees: picture, z-depth and labels of the wall."""
    rays = (pixel_centres(SIZE).numpy() - INTRINSICS[:2, 2]) / INTRINSICS[[0, 1], [0, 1]]
    depth = np.full(SIZE, WALL - 0.1 * shift)
    x, y = rays[..., 0] * depth + shift, rays[..., 1] * depth - 0.3 * shift
    picture = np.stack((np.sin(5 * x), np.cos(4 * y), np.sin(3 * (x + y))), axis=-1) * 0.4 + 0.5
    labels = np.where(x < 0.1, SCANNET20.index("wall"), SCANNET20.index("picture"))
    return np.rint(255 * picture).astype(np.uint8), depth, labels.astype(np.uint8)


@pytest.fixture
def wall_scene(tmp_path: Path) -> Callable[..., Scene]:
    """Writes and opens the scene: `wall_scene(metric=True, shifts=(0, 0.1, 0.2, 0.3))`."""

    def write(
        metric: bool = True, shifts: tuple[float, ...] = (0.0, 0.08, 0.16, 0.24), moved: Sequence[float] = (0, 0, 0)
    ) -> Scene:
        folder = tmp_path / f"wall_{moved[0]:g}" if any(moved) else tmp_path / "wall"
        for name in ("images", "depth", "labels"):
            (folder / name).mkdir(parents=True)
        frames = []
        for index, shift in enumerate(shifts):
            picture, depth, labels = look(shift)
            write_png(folder / f"images/{index:02d}.png", picture)
            opengl = wall_camera(shift).world_from_camera.numpy() @ np.diag([1, -1, -1, 1])
            opengl[:3, 3] += moved
            frame = {"file_path": f"images/{index:02d}.png", "transform_matrix": opengl.tolist()}
            if metric:
                write_png(folder / f"depth/{index:02d}.png", np.rint(1000 * depth).astype(np.uint16))
                write_png(folder / f"labels/{index:02d}.png", labels)
                frame |= {"depth_file_path": f"depth/{index:02d}.png", "label_file_path": f"labels/{index:02d}.png"}
            frames.append(frame)
        shared = {
            "camera_model": "PINHOLE", "w": SIZE[1], "h": SIZE[0], "fl_x": 52.0, "fl_y": 50.0, "cx": 27.0, "cy": 21.5,
            "label_set": "scannet20",
        }  # fmt: skip
        (folder / "transforms.json").write_text(json.dumps(shared | {"frames": frames}))
        return open_scene(folder)

    return write


class Oracle(nn.Module):
    """A network that knows how far the wall is: a Gaussian on it for each pixel, in the pixel's colour."""

    name = "oracle"

    def __init__(self, classes: ClassTable | None = SCANNET20) -> None:
        super().__init__()
        self.classes = classes
        self.start = torch.tensor([3.0, -1.0, 0.5], dtype=torch.float64)  # where the first camera is

    def forward(self, views: Views) -> Encoding:
        shifts = (views.cameras.centres - self.start) @ torch.from_numpy(TURN)
        depths = (WALL - shifts[:, 2]).float()[:, None, None].expand(-1, *views.size)
        means = back_project(depths, views.cameras).reshape(-1, 3)
        colours = (views.images.permute(0, 2, 3, 1).reshape(-1, 1, 3) - 0.5) / 0.28209479177387814
        turns = torch.tensor([1.0, 0, 0, 0]).expand(len(means), 4)
        scales = torch.full_like(means, 0.6 * WALL / 50)
        on_the_left = (means.double() - self.start) @ torch.from_numpy(TURN)[:, 0] < 0.1
        shares = torch.full((len(means), 20), 0.01)
        shares[torch.arange(len(means)), torch.where(on_the_left, 0, SCANNET20.index("picture"))] = 0.81
        return Encoding(
            Gaussians(
                means,
                torch.full((len(means),), 0.9),
                Appearance(turns, scales, colours),
                Appearance(turns, scales.clone(), shares) if self.classes is not None else None,
            ),
            depths,
            torch.full_like(depths, 0.5),
            torch.full_like(depths, 0.1),
            views.depth_range,
        )


@pytest.fixture
def oracle() -> Oracle:
    return Oracle()


@pytest.fixture
def colour_oracle() -> Oracle:
    return Oracle(classes=None)
