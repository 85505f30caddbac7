"""Draw docs/images/demo.png from what `make demo` wrote.

    semgs demo --out demo
    python scripts/draw_demo.py demo

Rows: the input views, then those held out. Columns: photo, render, classes, depth.
"""

from __future__ import annotations

import sys
from pathlib import Path

import cv2
import numpy as np

from semgs.figures.depth import depth_limits, depth_picture
from semgs.files.atomic import write_bytes
from semgs.files.pictures import png_bytes

TILE = (180, 240)
OUT = Path(__file__).resolve().parent.parent / "docs" / "images" / "demo.png"


def drawn(demo: Path) -> np.ndarray:
    """The picture [h w 3], RGB."""
    renders = demo / "renders"
    views = [
        (renders / f"{path.name.removesuffix('_image.png')}", "input" if path.name.startswith("context") else "truth")
        for path in sorted(renders.glob("*_image.png"))
    ]
    depths = [cv2.imread(f"{view}_depth.png", cv2.IMREAD_UNCHANGED).astype(np.float32) / 1000 for view, _ in views]
    limits = depth_limits(depths)
    rows = []
    for (view, photo), depth in zip(views, depths, strict=True):
        tiles = [cv2.imread(f"{view}_{name}.png")[..., ::-1] for name in (photo, "image", "classes")]
        tiles.append(depth_picture(depth, limits))
        rows.append(
            np.concatenate([cv2.resize(tile, TILE[::-1], interpolation=cv2.INTER_AREA) for tile in tiles], axis=1)
        )
    return np.concatenate(rows)


if __name__ == "__main__":
    if len(sys.argv) != 2:
        sys.exit(__doc__)
    write_bytes(OUT, png_bytes(drawn(Path(sys.argv[1]))))
