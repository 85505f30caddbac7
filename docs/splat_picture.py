"""Make the image of docs/splats.md: a splat of the included room before and after `semgs label-splat`, from the camera of a photo that neither used.

python docs/splat_picture.py
"""

from __future__ import annotations

from pathlib import Path

import numpy as np
from PIL import Image

from semgs import load, open_scene, refine, render
from semgs.data.demo_scene import demo_scene
from semgs.figures.class_images import class_picture, overlay
from semgs.figures.view_images import as_bytes
from semgs.geometry.gaussians import Gaussians
from semgs.objectives.metrics import psnr
from semgs.rendering.rendering import label_maps
from semgs.run.steps.result import GivenSplat
from semgs.run.steps.splat_labelling import NetworkClasses, label_splat
from semgs.segmenters.labelling import Labelling

PHOTOS, SHOWN = (3, 4, 5, 7), 6
"""Photos that the splat is made of and that say its classes, and the one that is shown."""


def main() -> None:
    """Write docs/images/splat.jpg, and print the PSNR of the splat and the accuracy of its classes."""
    scene, network = open_scene(demo_scene()), load("small")
    network.looks = 2
    views, photo = scene.read(PHOTOS), scene.read([SHOWN])
    made = refine(network(views), views).gaussians
    splat = Gaussians(made.means, made.opacities, made.colour)
    given = GivenSplat("room.ply", "PLY", len(PHOTOS))
    labelled = label_splat(scene, splat, Labelling(NetworkClasses(network)), given, PHOTOS).saved.gaussians
    rendering = render(labelled, photo.cameras)
    labels, classes = label_maps(rendering)[0], network.classes
    assert classes is not None
    assert photo.labels is not None
    truth = photo.labels[0].numpy()
    known = (truth < len(classes)) & (labels < len(classes))
    print(f"{float(psnr(rendering.images[0], photo.images[0])):.1f} dB, accuracy {(labels == truth)[known].mean():.3f}")
    image = as_bytes(rendering.images[0])
    strip = np.hstack((image, class_picture(labels, classes), overlay(image, labels, classes)))
    Image.fromarray(strip).save(Path(__file__).parent / "images" / "splat.jpg", quality=90)


if __name__ == "__main__":
    main()
