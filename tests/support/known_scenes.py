"""Small labelled scenes on disk, of any shape, with pictures, labels and depths that are known to the pixel."""

from __future__ import annotations

import json
from collections.abc import Callable, Sequence
from pathlib import Path

import numpy as np
import torch

from semgs.data.scene import Scene
from semgs.data.scenes import open_scene
from semgs.files.images.pictures import write_png
from semgs.geometry.rotations import matrix_from_quaternion

SIZE = (36, 48)
CLASSES = 6


def label_map(seed: int, size: tuple[int, int] = SIZE) -> np.ndarray:
    """Random labels in patches of 4 pixels, a tenth of them none."""
    rng = np.random.default_rng(seed)
    coarse = rng.integers(0, CLASSES, (-(-size[0] // 4), -(-size[1] // 4)))
    coarse[rng.random(coarse.shape) < 0.1] = 255
    return np.kron(coarse, np.ones((4, 4), int))[: size[0], : size[1]].astype(np.uint8)


def write_scene(
    folder: Path,
    frames: int = 5,
    size: tuple[int, int] = SIZE,
    *,
    labels: bool = True,
    depth: bool = True,
    positions: Sequence[float] | None = None,
    change: Callable[[dict], object] | None = None,
) -> Scene:
    """Write and open a scene of turned cameras at `positions` along a line; `change` edits its transforms.json."""
    turn = matrix_from_quaternion(torch.tensor([0.8, 0.3, -0.2, 0.4], dtype=torch.float64)).numpy()
    for name in ("images", "labels", "depth"):
        (folder / name).mkdir(parents=True)
    seed = int.from_bytes(folder.name.encode()) % 1000
    rows, columns = np.indices(size) / 7
    listed = []
    for index in range(frames):
        pose = np.eye(4)
        pose[:3, :3] = turn
        along = 0.1 * index if positions is None else positions[index]
        pose[:3, 3] = turn @ [along, 0.01 * index, 0.0] + [1.0, 2.0, -0.5]
        shifted = columns + 0.3 * index + seed % 7
        picture = 0.5 + 0.4 * np.stack((np.sin(shifted), np.cos(rows + shifted), np.sin(2 * rows)), axis=-1)
        write_png(folder / f"images/{index:03d}.png", np.rint(255 * picture).astype(np.uint8))
        entry = {"file_path": f"images/{index:03d}.png", "transform_matrix": (pose @ np.diag([1, -1, -1, 1])).tolist()}
        if labels:
            write_png(folder / f"labels/{index:03d}.png", label_map(seed + index, size))
            entry["label_file_path"] = f"labels/{index:03d}.png"
        if depth:
            write_png(folder / f"depth/{index:03d}.png", (2000 + 300 * np.sin(rows + index)).astype(np.uint16))
            entry["depth_file_path"] = f"depth/{index:03d}.png"
        listed.append(entry)
    scene = {
        "camera_model": "PINHOLE", "w": size[1], "h": size[0], "fl_x": 40.0, "fl_y": 41.0, "cx": 0.46 * size[1],
        "cy": 0.55 * size[0], "metric": True, "label_set": "scannet20", "frames": listed,
    }  # fmt: skip
    if change is not None:
        change(scene)
    (folder / "transforms.json").write_text(json.dumps(scene))
    return open_scene(folder)
