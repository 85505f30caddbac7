"""The files of a COLMAP model: cameras, images and points, binary (`.bin`) or text (`.txt`).

Poses are world to camera with OpenCV axes, and are inverted here. Intrinsics are in pixels with the centre of the first pixel at
(0.5, 0.5), like ours. Counts are compared with the size of the file before anything is allocated, and numbers and ids are checked. `rigs` and
`frames` of COLMAP 3.12 and newer are not needed: `images` still has the pose of every image in the world, also those of a rig.
https://colmap.github.io/format.html
"""

from __future__ import annotations

import mmap
import re
import struct
from collections.abc import Collection, Iterable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import torch

from semgs.data.cameras.fisheye import FisheyeLens
from semgs.data.cameras.formula_lens import FORMULAS, FormulaLens
from semgs.data.cameras.lens import AbstractLens, Lens
from semgs.files.contents import read_bytes
from semgs.files.errors import InputError, input_error, readable
from semgs.geometry.rotations import matrix_from_quaternion

PARAMETERS = {
    "SIMPLE_PINHOLE": ("f", "cx", "cy"),
    "PINHOLE": ("fx", "fy", "cx", "cy"),
    "SIMPLE_RADIAL": ("f", "cx", "cy", "k1"),
    "RADIAL": ("f", "cx", "cy", "k1", "k2"),
    "OPENCV": ("fx", "fy", "cx", "cy", "k1", "k2", "p1", "p2"),
    "OPENCV_FISHEYE": ("fx", "fy", "cx", "cy", "k1", "k2", "k3", "k4"),
    "FULL_OPENCV": ("fx", "fy", "cx", "cy", "k1", "k2", "p1", "p2", "k3", "k4", "k5", "k6"),
    "FOV": ("fx", "fy", "cx", "cy", "omega"),
    "SIMPLE_RADIAL_FISHEYE": ("f", "cx", "cy", "k1"),
    "RADIAL_FISHEYE": ("f", "cx", "cy", "k1", "k2"),
    "THIN_PRISM_FISHEYE": ("fx", "fy", "cx", "cy", "k1", "k2", "p1", "p2", "k3", "k4", "sx1", "sy1"),
    "RAD_TAN_THIN_PRISM_FISHEYE": (
        "fx", "fy", "cx", "cy", "k0", "k1", "k2", "k3", "k4", "k5", "p0", "p1", "s0", "s1", "s2", "s3",
    ),
    "SIMPLE_DIVISION": ("f", "cx", "cy", "k"),
    "DIVISION": ("fx", "fy", "cx", "cy", "k"),
    "SIMPLE_FISHEYE": ("f", "cx", "cy"),
    "FISHEYE": ("fx", "fy", "cx", "cy"),
    "EUCM": ("fx", "fy", "cx", "cy", "alpha", "beta"),
}  # fmt: skip
"""The supported camera models, in the order of their ids, and their parameters: all of COLMAP 4.2 but EQUIRECTANGULAR."""

EQUIDISTANT = ("SIMPLE_FISHEYE", "FISHEYE", "SIMPLE_RADIAL_FISHEYE", "RADIAL_FISHEYE", "OPENCV_FISHEYE")
"""Models of fisheye lenses with up to four radial coefficients, which are 0 in those that lack them."""

NAMES = (*PARAMETERS, "EQUIRECTANGULAR")
"""COLMAP's camera models, in the order of their ids."""

UNDISTORT = "undistort with `colmap image_undistorter` first"
"""What to do about a lens that is not supported."""

ADVICE = {
    "EQUIRECTANGULAR": "a panorama has no pinhole: cut it into perspective images first, as pycolmap's example panorama_sfm.py does"
}
"""What to do about some models."""

_POSITION = rb"(?:[-+]?(?:\d++(?:\.\d*+)?|\.\d++)(?:[eE][-+]?\d++)?|[-+]?(?:nan|inf))"
_IMAGE_POINTS = re.compile(rb"(?:%b\s++%b\s++-?\d++(?:\s++|$))++" % (_POSITION, _POSITION))
"""A line of images.txt that lists points, X Y POINT3D_ID each. Names may be of several words, too, but these are not all numbers."""

_COUNT = struct.Struct("<Q")
_CAMERA = struct.Struct("<IiQQ")
"""Id, model, width, height; then the parameters (f64)."""
_IMAGE = struct.Struct("<I7dI")
"""Id, quaternion (w, x, y, z) and translation, camera; then the name up to a zero byte, and the points."""
_IMAGE_POINT = 24
"""Bytes of a point of an image: x, y (f64), id (i64)."""
_POINT = struct.Struct("<Q3d3x8xQ")
"""Id, position, colour (3 u8) and error (f64), length of the track; then the track, pairs of u32."""
_SIGHTING = 8
"""Bytes of a pair in a track: image, point of that image."""


@dataclass(frozen=True)
class ColmapCamera:
    """A camera.

    Attributes:
        model: one of `PARAMETERS`.
        size: (height, width) [px].
        values: its parameters by name, with the corner of the first pixel at (0, 0).
    """

    model: str
    size: tuple[int, int]
    values: dict[str, float]

    @property
    def focal(self) -> tuple[float, float]:
        """(fx, fy) [px]."""
        return self.values.get("fx", self.values.get("f", 0.0)), self.values.get("fy", self.values.get("f", 0.0))

    @property
    def centre(self) -> tuple[float, float]:
        """(cx, cy) [px]."""
        return self.values["cx"], self.values["cy"]

    def lens(self, path: Path, key: str) -> AbstractLens:
        """The lens.

        Args:
            path: the file, for errors.
            key: the place in it.

        Raises:
            InputError: the parameters are impossible, or the image is wider than a pinhole can be.
        """
        name = self.model.removeprefix("SIMPLE_")
        with input_error(path, "a possible camera", key, None if self._like_a_pinhole else UNDISTORT):
            if self.model in EQUIDISTANT:
                k1, k2, k3, k4 = (self.values.get(name, 0.0) for name in ("k1", "k2", "k3", "k4"))
                return FisheyeLens(self.size, self.focal, self.centre, (k1, k2, k3, k4))
            if name in FORMULAS:
                return FormulaLens(self.size, self.focal, self.centre, name, self._coefficients)
            k1, k2, p1, p2 = (self.values.get(name, 0.0) for name in ("k1", "k2", "p1", "p2"))
            return Lens(self.size, self.focal, self.centre, (k1, k2, p1, p2, 0.0))

    @property
    def _coefficients(self) -> tuple[float, ...]:
        """The parameters of distortion, in COLMAP's order."""
        return tuple(value for name, value in self.values.items() if name not in ("f", "fx", "fy", "cx", "cy"))

    @property
    def _like_a_pinhole(self) -> bool:
        """Whether there is nothing to undistort."""
        return self.model in ("SIMPLE_PINHOLE", "PINHOLE")


@dataclass(frozen=True, eq=False)
class ColmapImage:
    """An image with its pose.

    Attributes:
        number: its id.
        name: as listed, decoded as UTF-8, or else as Latin-1.
        camera: its camera's id.
        world_from_camera: pose [4 4].
        place: in the file, for errors.
    """

    number: int
    name: str
    camera: int
    world_from_camera: np.ndarray
    place: str


@dataclass(frozen=True, eq=False)
class ColmapPoints:
    """The sparse points.

    Attributes:
        positions: in the world [n 3].
        seen: for each image id, the ascending indices of the points that it sees.
    """

    positions: np.ndarray
    seen: dict[int, np.ndarray]


def read_cameras(path: Path) -> dict[int, ColmapCamera]:
    """The cameras of a model by their ids.

    Args:
        path: `cameras.bin` or `cameras.txt`.

    Raises:
        InputError: the file cannot be read or is damaged, or a camera model is not supported.
    """
    cameras: dict[int, ColmapCamera] = {}
    for number, camera in (_binary_cameras if path.suffix == ".bin" else _text_cameras)(path):
        if number in cameras:
            raise InputError(path, "each camera once", f"camera {number} twice")
        cameras[number] = camera
    return cameras


def read_images(path: Path, cameras: Collection[int]) -> list[ColmapImage]:
    """The images of a model, in the order of the file.

    Args:
        path: `images.bin` or `images.txt`.
        cameras: the ids of the cameras.

    Raises:
        InputError: the file cannot be read or is damaged, an image has no pose or an unknown camera, or appears twice, or there are no cameras.
    """
    listed = list((_binary_images if path.suffix == ".bin" else _text_images)(path))
    poses = _world_from_camera(path, [one.pose for one in listed], [one.place for one in listed])
    known: set[int] = set()
    for one in listed:
        if one.number in known:
            raise InputError(path, "each image once", f"image {one.number} again", one.place)
        if not cameras:
            file = path.with_name(f"cameras{path.suffix}")
            raise InputError(file, "the cameras of the images", "none", advice="export the model again")
        if one.camera not in cameras:
            raise InputError(path, f"a camera that cameras{path.suffix} has", f"{one.camera}", one.place)
        known.add(one.number)
    return [
        ColmapImage(one.number, _decoded(one.name), one.camera, pose, one.place)
        for one, pose in zip(listed, poses, strict=True)
    ]


def read_points(path: Path, images: Collection[int], most: int) -> ColmapPoints:
    """The sparse points of a model and which images see them.

    Args:
        path: `points3D.bin` or `points3D.txt`.
        images: the ids of the images.
        most: find out which images see a point for at most this many points: every n-th.

    Raises:
        InputError: the file cannot be read or is damaged, or a point is seen by an unknown image.
    """
    positions, tracks = (_binary_points if path.suffix == ".bin" else _text_points)(path, most)
    finite = np.isfinite(positions).all(axis=1)
    if not finite.all():
        index = int(np.argmin(finite))
        raise InputError(path, "finite positions", f"{positions[index].tolist()}", f"entry {index}")
    pairs = [np.stack((np.full(len(track), index), track)) for index, track in tracks.items()]
    indices, seeing = np.concatenate(pairs, axis=1) if pairs else np.zeros((2, 0), np.int64)
    order = np.argsort(seeing, kind="stable")
    numbers, starts = np.unique(seeing[order], return_index=True)
    for number in numbers.tolist():
        if number not in images:
            raise InputError(path, "points that images of this model see", f"some seen by image {number}")
    groups = np.split(indices[order], starts[1:]) if len(numbers) else []
    return ColmapPoints(
        positions, {number: np.unique(group) for number, group in zip(numbers.tolist(), groups, strict=True)}
    )


@dataclass(frozen=True)
class _Listed:
    """An image as listed in a file; its pose is a quaternion (w, x, y, z) and a translation, world to camera."""

    number: int
    name: bytes
    camera: int
    pose: Sequence[float]
    place: str


def _binary_cameras(path: Path) -> Iterator[tuple[int, ColmapCamera]]:
    """The cameras of a binary file with their ids."""
    with _mapped(path) as data:
        at = _COUNT.size
        for _ in range(_count(path, data, _CAMERA.size)):
            number, model, width, height = _CAMERA.unpack_from(data, at)
            place, name = f"camera {number}", NAMES[model] if 0 <= model < len(NAMES) else f"number {model}"
            values = struct.Struct(f"<{len(_parameters(path, place, name))}d")
            yield number, _camera(path, place, name, (height, width), values.unpack_from(data, at + _CAMERA.size))
            at += _CAMERA.size + values.size
        _check_end(path, data, at)


def _text_cameras(path: Path) -> Iterator[tuple[int, ColmapCamera]]:
    """The cameras of a text file with their ids."""
    for line, text in _lines(path):
        place, words = f"line {line}", text.split()
        if len(words) < 4:
            raise InputError(path, "CAMERA_ID MODEL WIDTH HEIGHT PARAMS", _shown(text), place)
        number, width, height = _wholes(path, place, (words[0], *words[2:4]))
        name, values = _decoded(words[1]), _numbers(path, place, words[4:])
        wanted = len(_parameters(path, place, name))
        if len(values) != wanted:
            raise InputError(path, f"{wanted} parameters of {name}", f"{len(values)}", place)
        yield number, _camera(path, place, name, (height, width), values)


def _parameters(path: Path, place: str, model: str) -> tuple[str, ...]:
    """The parameters of a camera model."""
    if model not in PARAMETERS:
        raise InputError(path, "a camera model of " + ", ".join(PARAMETERS), model, place, ADVICE.get(model, UNDISTORT))
    return PARAMETERS[model]


def _camera(path: Path, place: str, model: str, size: tuple[int, int], values: Sequence[float]) -> ColmapCamera:
    """A camera from its parameters."""
    if not np.isfinite(values).all():
        raise InputError(path, f"finite parameters of {model}", f"{list(values)}", place)
    return ColmapCamera(model, size, dict(zip(PARAMETERS[model], values, strict=True)))


def _binary_images(path: Path) -> Iterator[_Listed]:
    """The images of a binary file."""
    with _mapped(path) as data:
        at = _COUNT.size
        for _ in range(_count(path, data, _IMAGE.size + 1 + _COUNT.size)):
            number, *pose, camera = _IMAGE.unpack_from(data, at)
            stop = data.find(b"\0", at + _IMAGE.size)
            if stop < 0:
                raise _incomplete(path)
            yield _Listed(number, data[at + _IMAGE.size : stop], camera, pose, f"image {number}")
            (points,) = _COUNT.unpack_from(data, stop + 1)
            at = stop + 1 + _COUNT.size + _IMAGE_POINT * points
        _check_end(path, data, at)


def _text_images(path: Path) -> Iterator[_Listed]:
    """The images of a text file. Each has a line, then one that lists its points, which may be empty; some programs leave it out."""
    may_follow = False
    for line, text in _lines(path):
        if may_follow and _IMAGE_POINTS.fullmatch(text):
            may_follow = False
            continue
        place, words = f"line {line}", text.split(maxsplit=9)
        if len(words) < 10:
            points = "the points of an image, X Y POINT3D_ID each, an empty line, or " if may_follow else ""
            expected = f"{points}IMAGE_ID QW QX QY QZ TX TY TZ CAMERA_ID NAME"
            raise InputError(path, expected, _shown(text), place)
        number, camera = _wholes(path, place, (words[0], words[8]))
        yield _Listed(number, words[9], camera, _numbers(path, place, words[1:8]), place)
        may_follow = True


def _binary_points(path: Path, most: int) -> tuple[np.ndarray, dict[int, np.ndarray]]:
    """The positions [n 3] of the points in a binary file, and for every n-th point the images that see it."""
    tracks = {}
    with _mapped(path) as data:
        at, count = _COUNT.size, _count(path, data, _POINT.size)
        positions, step = np.empty((count, 3)), 1 + count // most
        for index in range(count):
            _, x, y, z, length = _POINT.unpack_from(data, at)
            start, at = at + _POINT.size, at + _POINT.size + _SIGHTING * length
            if at > len(data):
                raise _incomplete(path)
            positions[index] = x, y, z
            if index % step == 0:
                tracks[index] = np.frombuffer(data[start:at], "<u4")[::2].astype(np.int64)
        _check_end(path, data, at)
    return positions, tracks


def _text_points(path: Path, most: int) -> tuple[np.ndarray, dict[int, np.ndarray]]:
    """As `_binary_points`, for a text file."""
    lines = list(_lines(path))
    tracks = {}
    positions, step = np.empty((len(lines), 3)), 1 + len(lines) // most
    for index, (line, text) in enumerate(lines):
        place, words = f"line {line}", text.split()
        if len(words) < 8 or len(words) % 2:
            raise InputError(
                path, "POINT3D_ID X Y Z R G B ERROR, then pairs of IMAGE_ID POINT2D_IDX", _shown(text), place
            )
        positions[index] = _numbers(path, place, words[1:8])[:3]
        if index % step == 0:
            tracks[index] = np.array(_wholes(path, place, words[8::2]), np.int64)
    return positions, tracks


def _world_from_camera(path: Path, poses: Sequence[Sequence[float]], places: Sequence[str]) -> np.ndarray:
    """Camera to world [n 4 4], from quaternions and translations, world to camera."""
    values = np.array(poses, np.float64).reshape(-1, 7)
    with np.errstate(over="ignore"):
        norms = np.linalg.norm(values[:, :4], axis=1)
    good = np.isfinite(values).all(axis=1) & (norms > 0.5) & (norms < 2)
    if not good.all():
        index = int(np.argmin(good))
        raise InputError(path, "a unit quaternion and a translation", f"{values[index].tolist()}", places[index])
    rotations = matrix_from_quaternion(torch.from_numpy(values[:, :4])).numpy().swapaxes(1, 2)
    matrices = np.tile(np.eye(4), (len(values), 1, 1))
    matrices[:, :3, :3], matrices[:, :3, 3:] = rotations, -rotations @ values[:, 4:, None]
    return matrices


@contextmanager
def _mapped(path: Path) -> Iterator[mmap.mmap]:
    """The bytes of a binary file. Reading beyond the end in the block becomes an InputError."""
    try:
        with readable(path), path.open("rb") as file:
            if not path.stat().st_size:
                raise _incomplete(path)
            with mmap.mmap(file.fileno(), 0, access=mmap.ACCESS_READ) as data:
                yield data
    except (struct.error, OverflowError) as error:  # the next entry would start beyond the end
        raise _incomplete(path) from error


def _count(path: Path, data: mmap.mmap, least: int) -> int:
    """The number of entries that a file states, each of at least so many bytes; they must fit into the file."""
    (count,) = _COUNT.unpack_from(data)
    if count > (len(data) - _COUNT.size) // least:
        raise _incomplete(path)
    return int(count)


def _check_end(path: Path, data: mmap.mmap, end: int) -> None:
    """Check that a file ends where its content does."""
    if end > len(data):
        raise _incomplete(path)
    if end < len(data):
        raise _incomplete(path, f"{len(data) - end} bytes after its end")


def _incomplete(path: Path, found: str = "a truncated one") -> InputError:
    """The error for a binary file of another length than its content."""
    return InputError(path, f"a complete list of COLMAP {path.stem}", found, advice="copy or export the model again")


def _lines(path: Path) -> Iterator[tuple[int, bytes]]:
    """The stripped lines of a text file with their numbers from 1, without comments and empty lines."""
    data = read_bytes(path).removeprefix(b"\xef\xbb\xbf")
    for number, line in enumerate(data.splitlines(), 1):
        stripped = line.strip()
        if stripped and not stripped.startswith(b"#"):
            yield number, stripped


def _numbers(path: Path, place: str, words: Iterable[bytes]) -> list[float]:
    """The numbers of a line."""
    with input_error(path, "numbers", place):
        return [float(word) for word in words]


def _wholes(path: Path, place: str, words: Sequence[bytes]) -> list[int]:
    """The integers of a line; COLMAP's ids have 32 bits."""
    for word in words:
        if not word.isdigit() or len(word) > 10 or int(word) >> 32:
            raise InputError(path, "a whole number", _shown(word), place)
    return [int(word) for word in words]


def _decoded(name: bytes) -> str:
    """A name. COLMAP writes the bytes of the file system, which may not be UTF-8."""
    try:
        return name.decode()
    except UnicodeDecodeError:
        return name.decode("latin-1")


def _shown(text: bytes) -> str:
    """The start of a line, for errors."""
    return _decoded(text[:60]) or "an empty line"
