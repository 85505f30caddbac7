"""Labelled images on disk, without cameras."""

from __future__ import annotations

import json
from collections.abc import Mapping
from pathlib import Path

import numpy as np

from semgs.files.images.pictures import write_png

CLASSES = {
    "classes": [
        {"id": 0, "name": "wall", "scannet20": "wall"},
        {"id": 1, "name": "floor", "scannet20": "floor"},
        {"id": 7, "name": "dresser", "scannet20": "cabinet"},
        {"id": 9, "name": "ceiling", "scannet20": None},
    ],
    "unknown": 200,
}
"""Numbers that mean three of ScanNet's classes, one that means none of them, and one for unknown."""


def write_image_set(folder: Path, labels: Mapping[str, np.ndarray], classes: object = None) -> Path:
    """A folder of images whose colour says their class: red where the number is 0, green elsewhere.

    Args:
        folder: to create.
        labels: the numbers of each image's pixels [h w], by its name.
        classes: the content of classes.json; None for `CLASSES`.
    """
    for part in ("images", "labels"):
        (folder / part).mkdir(parents=True)
    for name, numbers in labels.items():
        image = np.zeros((*numbers.shape, 3), np.uint8)
        image[..., 0] = 255 * (numbers == 0)
        image[..., 1] = 255 * (numbers != 0)
        write_png(folder / f"images/{name}.png", image)
        write_png(folder / f"labels/{name}.png", numbers.astype(np.uint8))
    (folder / "classes.json").write_text(json.dumps(CLASSES if classes is None else classes))
    return folder


def random_numbers(seed: int, size: tuple[int, int]) -> np.ndarray:
    """Numbers of `CLASSES` in squares of 8 pixels."""
    chosen = np.random.default_rng(seed).choice(
        np.array([0, 1, 7, 9, 200, 255], np.uint8), (size[0] // 8, size[1] // 8)
    )
    return np.kron(chosen, np.ones((8, 8), np.uint8))
