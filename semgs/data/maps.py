"""Sources of depth, labels and masks: the parts of a frame that read its maps.

A source returns a map for the pixels that a frame is read at. The sources here read files: they pass the stored map to `Pixels.taken`,
which applies undistortion, crop and resizing. A reader picks the sources that suit its files and needs no class of its own. Only a new way
to store maps needs a new source: a dataclass with a method `read`.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import ClassVar, Protocol, final, runtime_checkable

import numpy as np
import torch
from jaxtyping import Bool, Float32, Int32, Num, Shaped, UInt8

from semgs.data.cameras.lens import AbstractLens, carry_over
from semgs.data.resampling import kept_window, nearest
from semgs.data.tables.classes import IGNORE, ClassTable
from semgs.files.arrays import read_map
from semgs.files.errors import InputError
from semgs.files.images.pictures import TIFFS, read_numbers, read_tiff, read_uint8, read_uint16, read_visible
from semgs.files.stored import Stored
from semgs.geometry.cameras import Cameras, writable

ASPECT_TOLERANCE = 0.02
"""Depth and label maps may be smaller than their image, as on phones, if the aspects differ by no more than this fraction."""

SATURATED = 65535
"""The largest count of a 16-bit depth map. It means unknown, like 0: nothing was measured, or something too far away."""

FARTHEST = 65504.0
"""Floating-point depth from here on means unknown, too: the largest half float, and what renderers write for the background (Blender: 1e10)."""

MILLIMETRE = 0.001
"""Metres per count of most depth maps [m]."""


@final
@dataclass(frozen=True, eq=False)
class Pixels:
    """The pixels that a frame is read at.

    Attributes:
        lens: of the stored image.
        camera: the pinhole of the view, after undistortion and resizing.
        maps: the result of `lens.maps()`; None for a pinhole.
        crop: whether the image was cropped to the aspect of the camera's size (`reframed`) instead of stretched.
    """

    lens: AbstractLens
    camera: Cameras
    maps: tuple[np.ndarray, np.ndarray] | None = field(default=None, repr=False)
    crop: bool = False

    def of_file(self, path: Stored, values: Shaped[np.ndarray, "rows columns"]) -> Shaped[np.ndarray, "h w"]:
        """A map in a file, which may be smaller than the stored image, at the pixels of the view.

        Raises:
            InputError: it has another aspect than the image.
        """
        return self.taken(fit_to_image(path, values, self.lens.size))

    def taken(self, values: Shaped[np.ndarray, "rows columns"]) -> Shaped[np.ndarray, "h w"]:
        """A map of the stored image at the pixels of the view. Values are never interpolated.

        Raises:
            ValueError: it has another size than the image.
        """
        if values.shape != self.lens.size:
            raise ValueError(
                f"the map is {values.shape} (height, width); expected {self.lens.size}, the size of its image"
            )
        if self.maps is not None:
            values = self.lens.undistorted(values, self.maps, nearest=True)
        if self.camera.size == self.lens.size:
            return values
        if self.crop:
            top, left, height, width = kept_window(self.lens.size, self.camera.size)
            values = values[top : top + height, left : left + width]
        return nearest(torch.from_numpy(writable(values)), self.camera.size).numpy()


@runtime_checkable
class MapSource(Protocol):
    """Where the depth, the labels or the mask of a frame come from.

    Attributes:
        stored: whether maps are read from files rather than computed, so that frames can be chosen by them.
    """

    stored: ClassVar[bool]

    def read(self, pixels: Pixels) -> Shaped[np.ndarray, "h w"]:
        """The map at these pixels: z-depths (float32) [m], 0 where unknown; labels (uint8), 255 for none; or a mask, True where hidden.

        Raises:
            InputError: a file is missing or damaged, or does not match its image.
        """
        ...


@final
@dataclass(frozen=True)
class DepthMap:
    """Z-depths in a file: 16-bit PNG or PGM, `.npy`, or TIFF of 16 bits or floating-point numbers.

    Attributes:
        path: the file.
        unit: metres per count [m].
        rotated: whether the bits of each count are rotated left by three, as in SUN3D.
        confidence: a map of the same size, 8-bit PNG or `.npy`, 0 where the depth is unreliable and therefore unknown; None if there is none.
    """

    path: Stored
    unit: float = MILLIMETRE
    rotated: bool = False
    confidence: Stored | None = None
    stored: ClassVar[bool] = True

    def read(self, pixels: Pixels) -> Float32[np.ndarray, "h w"]:
        """As `MapSource.read`.

        Raises:
            InputError: as `MapSource.read`, or it has another aspect than the image.
        """
        return pixels.of_file(self.path, self.metres())

    def metres(self) -> Float32[np.ndarray, "rows columns"]:
        """The stored map [m], 0 where unknown.

        Raises:
            InputError: it, or its confidence, is missing, damaged or of another type.
        """
        counts = self._counts()
        depths = counts.astype(np.float32) * np.float32(self.unit)
        depths[~known_depths(counts)] = 0
        if self.confidence is not None:
            depths[self._confidences(self.confidence, depths.shape) == 0] = 0
        return depths

    @staticmethod
    def _confidences(path: Stored, shape: tuple[int, ...]) -> Num[np.ndarray, "rows columns"]:
        """The confidence of each depth of a map of this shape."""
        confidences = read_map(path) if path.suffix.lower() == ".npy" else read_uint8(path)
        if confidences.shape != shape:
            raise InputError(path, f"a map of {shape}, as its depth", f"{confidences.shape}")
        return confidences

    def _counts(self) -> Num[np.ndarray, "rows columns"]:
        """The stored counts."""
        ending = self.path.suffix.lower()
        if ending in TIFFS:
            return read_tiff(self.path)
        if ending != ".npy":
            counts = read_uint16(self.path)
            return (counts >> 3) | (counts << 13) if self.rotated else counts
        counts = read_map(self.path)
        if counts.ndim != 2:
            raise InputError(self.path, "an array [height width] of numbers", f"{counts.shape}")
        return counts


@final
@dataclass(frozen=True)
class DepthThroughLens:
    """A depth map of a separate depth camera with the same pose: each pixel gets the depth that its ray hits.

    Attributes:
        map: as the depth camera measured it.
        lens: the depth camera, a pinhole.
        of_picture: the true camera of the image, a pinhole, if the frame has another one (that of another paper's code); None for the
            frame's.
    """

    map: DepthMap
    lens: AbstractLens
    of_picture: AbstractLens | None = None
    stored: ClassVar[bool] = True

    def read(self, pixels: Pixels) -> Float32[np.ndarray, "h w"]:
        """As `MapSource.read`.

        Raises:
            InputError: as `MapSource.read`.
        """
        return pixels.taken(carry_over(self.map.metres(), self.lens, self.of_picture or pixels.lens))


@final
@dataclass(frozen=True)
class ClassMap:
    """Labels in a PNG.

    Attributes:
        path: the file.
        classes: the class table.
        meaning: the label of each number from 0 to 255, as `LabelSet.meaning`; None if the numbers are labels.
        key: what the map belongs to, for errors.
    """

    path: Stored
    classes: ClassTable
    meaning: tuple[int | None, ...] | None = field(default=None, repr=False)
    key: str | None = None
    stored: ClassVar[bool] = True

    def read(self, pixels: Pixels) -> UInt8[np.ndarray, "h w"]:
        """As `MapSource.read`.

        Raises:
            InputError: as `MapSource.read`, or it has another aspect than the image, or a label outside the table.
        """
        labels = read_labels(self.path, self.classes, self.key, self.meaning)
        return pixels.of_file(self.path, labels)


@final
@dataclass(frozen=True, eq=False)
class IdMap:
    """Ids of a data set, 8 or 16 bits, and their labels.

    Attributes:
        path: the file.
        labels: the label of every 16-bit id.
    """

    path: Stored
    labels: UInt8[np.ndarray, " 65536"] = field(repr=False)
    stored: ClassVar[bool] = True

    def read(self, pixels: Pixels) -> UInt8[np.ndarray, "h w"]:
        """As `MapSource.read`.

        Raises:
            InputError: as `MapSource.read`, or it has another aspect than the image.
        """
        return pixels.of_file(self.path, self.labels[read_numbers(self.path)])


@final
@dataclass(frozen=True)
class InstanceMap:
    """Numbers of things in a PNG, 0 for none: pixels of one class with one number are one thing.

    Attributes:
        path: the file.
    """

    path: Stored
    stored: ClassVar[bool] = True

    def read(self, pixels: Pixels) -> Int32[np.ndarray, "h w"]:
        """As `MapSource.read`.

        Raises:
            InputError: as `MapSource.read`, or it has another aspect than the image.
        """
        numbers = read_numbers(self.path).astype(np.int32)
        return pixels.of_file(self.path, numbers)


@final
@dataclass(frozen=True)
class MaskMap:
    """A mask in a PNG: dark pixels are hidden, as `read_visible`.

    Attributes:
        path: the file.
    """

    path: Stored
    stored: ClassVar[bool] = True

    def read(self, pixels: Pixels) -> Bool[np.ndarray, "h w"]:
        """As `MapSource.read`.

        Raises:
            InputError: as `MapSource.read`, or it has another aspect than the image.
        """
        visible = read_visible(self.path).astype(np.uint8)
        return pixels.of_file(self.path, visible) == 0


@final
@dataclass(frozen=True, eq=False)
class InMemory:
    """A map in memory, for the pixels of the stored image.

    Attributes:
        values: z-depths (float32) [m], 0 where unknown, or labels (uint8), 255 for none.
    """

    values: Shaped[np.ndarray, "rows columns"] = field(repr=False)
    stored: ClassVar[bool] = True

    def read(self, pixels: Pixels) -> Shaped[np.ndarray, "h w"]:
        """As `MapSource.read`.

        Raises:
            ValueError: it has another size than the image.
        """
        return pixels.taken(self.values)


def known_depths(counts: Num[np.ndarray, "*axes"]) -> Bool[np.ndarray, "*axes"]:
    """Where depth as stored is known: finite, positive, and not what stands for something too far away."""
    farthest = FARTHEST if counts.dtype.kind == "f" else np.iinfo(counts.dtype).max
    return np.isfinite(counts) & (counts > 0) & (counts < farthest)


def fit_to_image(
    path: Stored, values: Shaped[np.ndarray, "rows columns"], size: tuple[int, int]
) -> Shaped[np.ndarray, "h w"]:
    """A map resized to its image: each pixel takes the value of the pixel that its centre lies in.

    Args:
        path: the map's file, for the error.
        values: the map.
        size: (height, width) of the image.

    Raises:
        InputError: it has another aspect than the image.
    """
    (height, width), (rows, columns) = size, values.shape
    if (rows, columns) == size:
        return values
    if not rows or not columns or abs(rows * width / (columns * height) - 1) > ASPECT_TOLERANCE:
        raise InputError(path, f"{width}x{height} pixels (width x height), the size of its image", f"{columns}x{rows}")
    return nearest(torch.from_numpy(values), size).numpy()


def read_labels(
    path: Stored, classes: ClassTable, key: str | None = None, meaning: Sequence[int | None] | None = None
) -> UInt8[np.ndarray, "h w"]:
    """A class map: labels of the table, or 255 for none.

    Args:
        path: the PNG.
        classes: the class table.
        key: what the map belongs to, for the error.
        meaning: the label of each number from 0 to 255, None for a number that must not occur; None if the numbers are labels.

    Raises:
        InputError: it is missing or damaged, or has a label outside the table.
    """
    known = [*range(len(classes)), *[None] * (IGNORE - len(classes)), IGNORE] if meaning is None else meaning
    positions = {(0, 0, 0): IGNORE} | {
        colour: known.index(label) for label, colour in enumerate(classes.colours) if label in known
    }
    numbers = read_numbers(path, positions)
    labels = np.full(1 << 16, -1, np.int16)
    labels[: len(known)] = [-1 if label is None else label for label in known]
    found = labels[numbers]
    if (found < 0).any():
        expected = f"labels 0..{len(classes) - 1} of table {classes.name}, or {IGNORE} for none"
        raise InputError(
            path,
            expected if meaning is None else f"the numbers of table {classes.name}",
            f"{int(numbers[found < 0][0])} at {(found < 0).sum()} pixels",
            key=key,
        )
    return found.astype(np.uint8)
