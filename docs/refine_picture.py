"""Make the image of docs/refine.md: a photo of the included room that no input view is, one pass, and refined.

python docs/refine_picture.py
"""

from __future__ import annotations

from pathlib import Path

import numpy as np
from PIL import Image

from semgs import load, open_scene, refine
from semgs.data.demo_scene import demo_scene
from semgs.figures.view_images import as_bytes
from semgs.objectives.metrics import psnr

INPUT, BETWEEN = (5, 7), 6
"""Frames: `make demo` chooses these input views too."""


def main() -> None:
    """Write docs/images/refine.jpg, and print the PSNR of both renderings."""
    scene = open_scene(demo_scene())
    views, photo = scene.read(INPUT), scene.read([BETWEEN])
    encoding = load("small")(views)
    shown = [photo.images[0]]
    for made in (encoding, refine(encoding, views)):
        shown.append(made.render(photo.cameras).images[0])
        print(f"{float(psnr(shown[-1], photo.images[0])):.2f} dB")
    strip = np.hstack([as_bytes(image) for image in shown])
    Image.fromarray(strip).save(Path(__file__).parent / "images" / "refine.jpg", quality=90)


if __name__ == "__main__":
    main()
