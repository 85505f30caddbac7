"""Make docs/images/demo.jpg from the output of `semgs demo`: first the input views, then the target views, one per row, with titles and a legend."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import cv2
import numpy as np
from PIL import Image, ImageDraw, ImageFont

from paper.release.pages import DOCS
from semgs.data.tables.classes import SCANNET20
from semgs.figures.class_images import LegendEntry, legend
from semgs.files.atomic import write_bytes
from semgs.files.errors import InputError
from semgs.files.images.colours import depth_limits, depth_picture
from semgs.files.images.pictures import jpeg_bytes, read_rgb, read_uint8, read_uint16

TILE = (180, 240)
"""(height, width) of each tile [px]."""


def write_picture(demo: Path) -> None:
    """Write the image. Raises what `demo_picture` raises."""
    stems = sorted(path.name.removesuffix("_image.png") for path in (demo / "renders").glob("*_image.png"))
    labels = [read_uint8(demo / "renders" / f"{stem}_labels.png") for stem in stems]
    rows = ["input photo" if stem.startswith("context") else "held-out photo" for stem in stems]
    picture = titled(
        demo_picture(demo), ("photo", "rendered", "classes", "depth: red is near"), rows, legend(labels, SCANNET20)[:8]
    )
    write_bytes(DOCS / "images" / "demo.jpg", jpeg_bytes(picture, 88))


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


def titled(
    picture: np.ndarray, columns: Sequence[str], rows: Sequence[str] = (), entries: Sequence[LegendEntry] = ()
) -> np.ndarray:
    """An image of tiles with a title above each column, a name on the left of each row, and a legend below."""
    font, (height, width, _) = ImageFont.load_default(15), picture.shape
    left, top, bottom = (24 if rows else 0), 24, (26 if entries else 0)
    sheet = Image.new("RGB", (left + width, top + height + bottom), "white")
    sheet.paste(Image.fromarray(picture), (left, top))
    draw = ImageDraw.Draw(sheet)
    for number, title in enumerate(columns):
        draw.text((left + (number + 0.5) * width / len(columns), top / 2), title, "black", font, "mm")
    for number, name in enumerate(rows):
        side = Image.new("RGB", (height // len(rows), left), "white")
        ImageDraw.Draw(side).text((side.width / 2, left / 2), name, "black", font, "mm")
        sheet.paste(side.rotate(90, expand=True), (0, top + number * height // len(rows)))
    x = left + 4.0
    for entry in entries:
        y = top + height + bottom / 2
        draw.rectangle((x, y - 7, x + 14, y + 7), entry.colour)
        draw.text((x + 20, y), entry.name, "black", font, "lm")
        x += 20 + font.getlength(entry.name) + 16
    return np.asarray(sheet)
