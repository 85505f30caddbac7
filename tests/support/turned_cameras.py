"""A small metric scene on disk, seen from turned cameras."""

from __future__ import annotations

import json
from collections.abc import Callable
from pathlib import Path

import numpy as np

from semgs.files.images.pictures import write_png
from semgs.geometry.rotations import matrix_from_quaternion

SIZE = (48, 64)


def write_scene(folder: Path, change: Callable[[dict], object] | None = None, frames: int = 4) -> Path:
    """A metric scene of smooth pictures from turned cameras 12 cm apart; `change` edits its transforms.json."""
    import torch

    turn = matrix_from_quaternion(torch.tensor([0.8, 0.3, -0.2, 0.4], dtype=torch.float64)).numpy()
    (folder / "images").mkdir(parents=True)
    rows, columns = np.indices(SIZE) / 10
    listed = []
    for index in range(frames):
        pose = np.eye(4)
        pose[:3, :3] = turn
        pose[:3, 3] = turn @ [0.12 * index, 0.02 * index, 0.0] + [1.0, 2.0, -0.5]
        shifted = columns + 0.4 * index
        picture = 0.5 + 0.4 * np.stack((np.sin(shifted), np.cos(rows + shifted), np.sin(2 * rows)), axis=-1)
        write_png(folder / f"images/{index:03d}.png", np.rint(255 * picture).astype(np.uint8))
        listed.append({"file_path": f"images/{index:03d}.png", "transform_matrix": pose.tolist()})
    scene = {
        "camera_model": "PINHOLE", "w": SIZE[1], "h": SIZE[0], "fl_x": 60.0, "fl_y": 58.0, "cx": 30.5, "cy": 25.0,
        "metric": True, "frames": listed,
    }  # fmt: skip
    if change is not None:
        change(scene)
    (folder / "transforms.json").write_text(json.dumps(scene))
    return folder
