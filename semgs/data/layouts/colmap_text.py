"""COLMAP's `cameras.txt` and `images.txt`, without the points: all that a scene with a mesh needs, and no pycolmap to read it.

https://colmap.github.io/format.html#text-format
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import torch

from semgs.files.errors import InputError
from semgs.geometry.rotations import matrix_from_quaternion

PARAMETERS = {
    "SIMPLE_PINHOLE": ("f", "cx", "cy"),
    "PINHOLE": ("fx", "fy", "cx", "cy"),
    "SIMPLE_RADIAL": ("f", "cx", "cy", "k1"),
    "RADIAL": ("f", "cx", "cy", "k1", "k2"),
    "OPENCV": ("fx", "fy", "cx", "cy", "k1", "k2", "p1", "p2"),
    "OPENCV_FISHEYE": ("fx", "fy", "cx", "cy", "k1", "k2", "k3", "k4"),
}
"""The camera models that are read, and what their parameters are."""


@dataclass(frozen=True)
class TextCamera:
    """A line of `cameras.txt`.

    Attributes:
        model: one of `PARAMETERS`.
        size: (height, width) [px].
        values: its parameters by name; the corner of the first pixel is at (0, 0).
    """

    model: str
    size: tuple[int, int]
    values: dict[str, float]


@dataclass(frozen=True, eq=False)
class TextImage:
    """An image of `images.txt`.

    Attributes:
        name: as listed.
        camera: its camera's number.
        world_from_camera: pose [4 4].
        place: its line, for messages.
    """

    name: str
    camera: int
    world_from_camera: np.ndarray
    place: str


def read_cameras(path: Path) -> dict[int, TextCamera]:
    """The cameras of a model by their numbers.

    Raises:
        InputError: the file cannot be read, a line is broken, or a camera has another model than `PARAMETERS`.
    """
    cameras = {}
    for number, words in _lines(path):
        place = f"line {number}"
        if len(words) < 4:
            raise InputError(path, "CAMERA_ID MODEL WIDTH HEIGHT PARAMS", " ".join(words)[:40], key=place)
        model = words[1]
        if model not in PARAMETERS:
            raise InputError(path, "a camera model of " + ", ".join(PARAMETERS), model, key=place)
        names, values = PARAMETERS[model], _numbers(path, place, words[4:])
        if len(values) != len(names):
            raise InputError(path, f"{len(names)} parameters of {model}", f"{len(values)}", key=place)
        identity, width, height = (_whole(path, place, word) for word in (words[0], words[2], words[3]))
        cameras[identity] = TextCamera(model, (height, width), dict(zip(names, values, strict=True)))
    return cameras


def read_images(path: Path) -> list[TextImage]:
    """The images of a model, in the order of the file; the line of points behind each is passed over.

    Raises:
        InputError: the file cannot be read, or a line is broken.
    """
    images = []
    lines = _lines(path, keep_empty=True)
    for number, words in lines:
        if not words:
            continue
        place = f"line {number}"
        if len(words) < 10:
            raise InputError(path, "IMAGE_ID QW QX QY QZ TX TY TZ CAMERA_ID NAME", " ".join(words)[:40], key=place)
        values = np.array(_numbers(path, place, words[1:8]))
        norm = float(np.linalg.norm(values[:4]))
        if not (np.isfinite(values).all() and 0.5 < norm < 2):
            raise InputError(path, "a unit quaternion and a translation", " ".join(words[1:8])[:60], key=place)
        rotation = matrix_from_quaternion(torch.from_numpy(values[:4])).numpy()
        pose = np.eye(4)
        pose[:3, :3], pose[:3, 3] = rotation.T, -rotation.T @ values[4:]
        images.append(TextImage(" ".join(words[9:]), _whole(path, place, words[8]), pose, place))
        next(lines, None)  # its points, perhaps none
    return images


def _lines(path: Path, keep_empty: bool = False) -> Iterator[tuple[int, list[str]]]:
    """The lines of a file with their numbers, split into words; comments are left out, and empty lines unless they are kept.

    Raises:
        InputError: it cannot be read.
    """
    try:
        text = path.read_bytes().decode("utf-8-sig")
    except OSError as error:
        raise InputError(path, "a readable file", error.strerror or str(error)) from error
    except UnicodeDecodeError as error:
        raise InputError(path, "a text file", "something else") from error
    for number, line in enumerate(text.splitlines(), 1):
        if not line.startswith("#") and (keep_empty or line.strip()):
            yield number, line.split()


def _numbers(path: Path, place: str, words: list[str]) -> list[float]:
    """Numbers of a line.

    Raises:
        InputError: a word is none.
    """
    try:
        return [float(word) for word in words]
    except ValueError as error:
        raise InputError(path, "numbers", str(error), key=place) from error


def _whole(path: Path, place: str, word: str) -> int:
    """A whole number of a line.

    Raises:
        InputError: it is none.
    """
    if not word.isdecimal():
        raise InputError(path, "a whole number", repr(word), key=place)
    return int(word)
