"""Make the image at the top of docs/segmenters.md.

    python docs/segmenter_picture.py OFFICE mosaic.tflite

OFFICE is the scene hololens_office. The page describes the network and the JSON file that must be beside it. The columns are two input
photos and a held-out one; the rows are the photos, the rendered classes of the included weights, and those with the network.
"""

from __future__ import annotations

import argparse
from pathlib import Path

import numpy as np
from PIL import Image

from semgs import load, open_scene, segmenters
from semgs.figures.class_images import class_picture
from semgs.figures.view_images import as_bytes
from semgs.rendering.rendering import label_maps

FRAMES = (0, 4, 3)
"""The frames of the columns: two input views, and a held-out one."""

SIZE = (224, 336)
"""Height and width of each image."""


def main() -> None:
    """Write docs/images/segmenter.jpg."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("office", type=Path)
    parser.add_argument("network", type=Path)
    given = parser.parse_args()
    scene = open_scene(given.office)
    views, photos = scene.read(FRAMES, SIZE), scene.read(FRAMES[:2], SIZE)
    segmenter = segmenters.open(given.network)
    network = load("small")
    network.looks = 2
    own = network(photos)
    rows = [[as_bytes(image) for image in views.images]]
    for encoding in (own, own.with_classes(segmenter(photos), segmenter.classes)):
        labels = label_maps(encoding.render(views.cameras))
        rows.append([class_picture(one, segmenter.classes) for one in labels])
    strip = np.vstack([np.hstack(row) for row in rows])
    Image.fromarray(strip).save(Path(__file__).parent / "images" / "segmenter.jpg", quality=85)


if __name__ == "__main__":
    main()
