"""Make docs/images/demo.png from the output of `semgs demo`: first the input views, then the target views, one per row."""

from __future__ import annotations

from pathlib import Path

import cv2
import numpy as np

from semgs.files.atomic import write_bytes
from semgs.files.errors import InputError
from semgs.files.images.colours import depth_limits, depth_picture
from semgs.files.images.pictures import png_bytes, read_rgb, read_uint16
from tools.release.pages import DOCS

TILE = (180, 240)
"""(height, width) of each tile [px]."""


def write_picture(demo: Path) -> None:
    """Write the image. Raises what `demo_picture` raises."""
    write_bytes(DOCS / "images" / "demo.png", png_bytes(demo_picture(demo)))


def demo_picture(demo: Path) -> np.ndarray:
    """The image [h w 3], RGB: photo, render, classes and depth of each view side by side.

    Raises:
        InputError: the folder is not from `semgs demo`.
    """
    renders = demo / "renders"
    if not renders.is_dir():
        raise InputError(demo, "a folder that semgs demo wrote", "no renders/ in it")
    stems = [path.name.removesuffix("_image.png") for path in sorted(renders.glob("*_image.png"))]
    views = [(renders / stem, "input" if stem.startswith("context") else "truth") for stem in stems]
    depths = [read_uint16(Path(f"{view}_depth.png")).astype(np.float32) / 1000 for view, _ in views]
    limits = depth_limits(depths)
    rows = []
    for (view, photo), depth in zip(views, depths, strict=True):
        tiles = [read_rgb(Path(f"{view}_{name}.png")) for name in (photo, "image", "classes")]
        tiles.append(depth_picture(depth, limits))
        small = [cv2.resize(tile, TILE[::-1], interpolation=cv2.INTER_AREA) for tile in tiles]
        rows.append(np.concatenate(small, axis=1))
    return np.concatenate(rows)
