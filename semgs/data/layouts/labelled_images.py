"""Labelled images: photos of any rooms with class labels and without cameras. Classes are trained and scored on them, one image at a time.

    images/NAME.jpg       the images, of any size: JPEG or PNG
    labels/NAME.png       for each image, the class number of each pixel, 8 bits
    classes.json          what the numbers mean

`classes.json` is a class file (`semgs.data.tables.class_files`): a table of its own, or the one of ScanNet's 20 classes that each number is.
"""

from __future__ import annotations

from pathlib import Path

import numpy as np

from semgs.data.cameras.lens import Lens
from semgs.data.frames import Frame
from semgs.data.layouts.parts.usable_frames import pictures_in
from semgs.data.maps import ClassMap
from semgs.data.scene import Scene
from semgs.data.tables.class_files import read_class_file
from semgs.files.errors import InputError
from semgs.files.images.pictures import read_header

LAYOUT = "labelled images"

CLASSES = "classes.json"
FOCAL = 0.9
"""Focal length of every image relative to its longer side, about that of a phone. Nothing depends on it, as classes are predicted without cameras."""


def recognises(path: Path) -> bool:
    """Whether a path is a folder of labelled images."""
    return (path / CLASSES).is_file() and (path / "images").is_dir() and (path / "labels").is_dir()


def open_labelled_images(path: Path) -> Scene:
    """All images of a folder as one scene without cameras, in the order of their names.

    Raises:
        InputError: there is no image, an image has no labels, two have the same name, or `classes.json` is damaged.
    """
    label_set = read_class_file(path / CLASSES)
    names: dict[str, Path] = {}
    for image in pictures_in(path / "images"):
        if image.stem in names:
            raise InputError(image, "images of different names", f"{image.stem}, as {names[image.stem].name}")
        names[image.stem] = image
    frames = []
    for stem, image in names.items():
        labels = path / "labels" / f"{stem}.png"
        if not labels.is_file():
            raise InputError(labels, f"the labels of {image.name}", "no such file")
        height, width = read_header(image).size
        lens = Lens((height, width), (FOCAL * max(height, width),) * 2, (width / 2, height / 2))
        source = ClassMap(labels, label_set.table, label_set.meaning, f"image {image.name}")
        frames.append(Frame(f"images/{image.name}", image, lens, np.eye(4), labels=source))
    if not frames:
        raise InputError(path / "images", "images", "none")
    return Scene(
        path=path, name=path.absolute().name, layout=LAYOUT, unit="unknown", frames=tuple(frames),
        classes=label_set.table, posed=False,
    )  # fmt: skip
