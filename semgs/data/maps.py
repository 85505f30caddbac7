"""Sources of depth, labels and masks: small parts that a frame is made of, each of which reads itself.

A source gives a map for the pixels that a frame is read at. Those here read files: they give `Pixels.taken` what is stored in the
pixels of the picture, and distortion, crop and size are dealt with there. A reader picks the sources that suit its files and writes
no class; only what is stored in a way that nobody stored it before needs a new one, which is a dataclass with a method `read`.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import ClassVar, Protocol, final, runtime_checkable

import numpy as np
import torch
from jaxtyping import Bool, Float32, Num, Shaped, UInt8

from semgs.data.classes import IGNORE, ClassTable
from semgs.data.lens import AbstractLens, carried_over
from semgs.data.resampling import kept_window, nearest
from semgs.files.arrays import read_array
from semgs.files.contents import read_bytes
from semgs.files.errors import InputError
from semgs.files.pictures import decode_map, read_uint8, read_uint16
from semgs.files.stored import Stored
from semgs.geometry.cameras import Cameras

ASPECT_TOLERANCE = 0.02
"""Depth and label maps may be smaller than their picture, as phones' are, if their aspect is the same to this fraction."""

SATURATED = 65535
"""The largest count of a 16-bit depth map: nothing was measured, or something beyond. Unknown, as 0 is."""

VISIBLE = 128
"""Masks are 255 where a picture may be looked at and 0 where it may not; a film's in between."""


@final
@dataclass(frozen=True, eq=False)
class Pixels:
    """The pixels that a frame is read at.

    Attributes:
        lens: of the picture as it is stored.
        camera: the one pinhole that is read, its distortion undone, resized.
        maps: what `lens.maps()` gives; None for a pinhole.
        crop: whether the picture was cropped to the aspect of the camera's size, as `reframed`; else it was stretched.
    """

    lens: AbstractLens
    camera: Cameras
    maps: tuple[np.ndarray, np.ndarray] | None = field(default=None, repr=False)
    crop: bool = False

    def taken(self, values: Shaped[np.ndarray, "rows columns"]) -> Shaped[np.ndarray, "h w"]:
        """Of a map of the picture as it is stored, the value at each pixel; nothing is mixed.

        Raises:
            ValueError: it has another size than the picture.
        """
        if values.shape != self.lens.size:
            raise ValueError(f"the map is {values.shape} (height, width); expected {self.lens.size}, as its picture")
        if self.maps is not None:
            values = self.lens.undistorted(values, self.maps, nearest=True)
        if self.camera.size == self.lens.size:
            return values
        if self.crop:
            top, left, height, width = kept_window(self.lens.size, self.camera.size)
            values = values[top : top + height, left : left + width]
        return nearest(torch.from_numpy(values), self.camera.size).numpy()


@runtime_checkable
class MapSource(Protocol):
    """Where the depth, the labels or the mask of a frame come from.

    Attributes:
        stored: whether they are read rather than computed, so that frames may be chosen by them.
    """

    stored: ClassVar[bool]

    def read(self, pixels: Pixels) -> Shaped[np.ndarray, "h w"]:
        """The map at some pixels: z-depths (float32) [m], 0 where unknown; labels (uint8), 255 for none; or True where hidden.

        Raises:
            InputError: a file is absent, damaged, or does not go with its picture.
        """
        ...


@final
@dataclass(frozen=True)
class DepthMap:
    """Z-depths in a file: 16-bit PNG or PGM, or `.npy`.

    Attributes:
        path: the file, or whatever holds or yields it.
        unit: what one count is worth [m].
        rotated: whether the bits of each count are rotated by three to the left, as SUN3D's are.
    """

    path: Stored
    unit: float = 0.001
    rotated: bool = False
    stored: ClassVar[bool] = True

    def read(self, pixels: Pixels) -> Float32[np.ndarray, "h w"]:
        """As `MapSource.read`.

        Raises:
            InputError: as `MapSource.read`; its aspect is not the picture's.
        """
        return pixels.taken(fitted(self.path, self.metres(), pixels.lens.size))

    def metres(self) -> Float32[np.ndarray, "rows columns"]:
        """The map at its own size [m], 0 where unknown.

        Raises:
            InputError: it is absent, damaged or of another type.
        """
        counts = self._counts()
        depths = counts.astype(np.float32) * np.float32(self.unit)
        depths[~np.isfinite(depths) | (depths < 0)] = 0
        if counts.dtype == np.uint16:
            depths[counts == SATURATED] = 0
        return depths

    def _counts(self) -> Num[np.ndarray, "rows columns"]:
        """What is stored."""
        if self.path.suffix.lower() != ".npy":
            counts = read_uint16(self.path)
            return (counts >> 3) | (counts << 13) if self.rotated else counts
        counts = read_array(self.path)
        if counts.ndim != 2:
            raise InputError(self.path, "an array [height width] of numbers", f"{counts.shape}")
        return counts


@final
@dataclass(frozen=True)
class DepthThroughLens:
    """A depth map of a camera of its own, at the place of the one that took the picture: each pixel gets the depth that its ray meets.

    Attributes:
        map: as that camera measured it.
        lens: that camera, a pinhole.
        of_picture: the camera of the picture, a pinhole, if the frame's is what somebody else takes it for; None is the frame's.
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
        return pixels.taken(carried_over(self.map.metres(), self.lens, self.of_picture or pixels.lens))


@final
@dataclass(frozen=True)
class ClassMap:
    """Labels in an 8-bit PNG.

    Attributes:
        path: the file, or whatever holds or yields it.
        classes: the table.
        meaning: of each number from 0 to 255, as `LabelSet.meaning`; None where they are labels already.
        key: what it is of, for errors.
    """

    path: Stored
    classes: ClassTable
    meaning: tuple[int | None, ...] | None = field(default=None, repr=False)
    key: str | None = None
    stored: ClassVar[bool] = True

    def read(self, pixels: Pixels) -> UInt8[np.ndarray, "h w"]:
        """As `MapSource.read`.

        Raises:
            InputError: as `MapSource.read`; its aspect is not the picture's, or a label is outside the table.
        """
        labels = read_labels(self.path, self.classes, self.key, self.meaning)
        return pixels.taken(fitted(self.path, labels, pixels.lens.size))


@final
@dataclass(frozen=True, eq=False)
class IdMap:
    """Ids of a data set, 8 or 16 bits, and what they mean.

    Attributes:
        path: the file, or whatever holds or yields it.
        labels: the label of every id that 16 bits hold.
    """

    path: Stored
    labels: UInt8[np.ndarray, 65536] = field(repr=False)
    stored: ClassVar[bool] = True

    def read(self, pixels: Pixels) -> UInt8[np.ndarray, "h w"]:
        """As `MapSource.read`.

        Raises:
            InputError: as `MapSource.read`; its aspect is not the picture's.
        """
        return pixels.taken(fitted(self.path, self.labels[read_ids(self.path)], pixels.lens.size))


@final
@dataclass(frozen=True)
class MaskMap:
    """Where a picture may not be looked at, in an 8-bit PNG: dark places are hidden.

    Attributes:
        path: the file, or whatever holds or yields it.
    """

    path: Stored
    stored: ClassVar[bool] = True

    def read(self, pixels: Pixels) -> Bool[np.ndarray, "h w"]:
        """As `MapSource.read`.

        Raises:
            InputError: as `MapSource.read`; its aspect is not the picture's.
        """
        return pixels.taken(fitted(self.path, read_uint8(self.path), pixels.lens.size)) < VISIBLE


@final
@dataclass(frozen=True, eq=False)
class InMemory:
    """A map that is an array already, in the pixels of the picture as it is stored.

    Attributes:
        values: z-depths (float32) [m], 0 where unknown, or labels (uint8), 255 for none.
    """

    values: Shaped[np.ndarray, "rows columns"] = field(repr=False)
    stored: ClassVar[bool] = True

    def read(self, pixels: Pixels) -> Shaped[np.ndarray, "h w"]:
        """As `MapSource.read`.

        Raises:
            ValueError: it has another size than the picture.
        """
        return pixels.taken(self.values)


def fitted(
    path: Stored, values: Shaped[np.ndarray, "rows columns"], size: tuple[int, int]
) -> Shaped[np.ndarray, "h w"]:
    """A map at the size of its picture, each pixel from the one that its centre lies in.

    Args:
        path: of the map, for the error.
        values: the map.
        size: (height, width) of the picture.

    Raises:
        InputError: its aspect is not the picture's.
    """
    (height, width), (rows, columns) = size, values.shape
    if (rows, columns) == size:
        return values
    if not rows or not columns or abs(rows * width / (columns * height) - 1) > ASPECT_TOLERANCE:
        raise InputError(path, f"{width}x{height} pixels (width x height), as its picture", f"{columns}x{rows}")
    return nearest(torch.from_numpy(values), size).numpy()


def read_ids(path: Stored) -> np.ndarray:
    """The ids that a label map holds, uint8 or uint16 [h w].

    Raises:
        InputError: it cannot be read, or is no map.
    """
    return decode_map(read_bytes(path, "a label map"), path)


def read_labels(
    path: Stored, classes: ClassTable, key: str | None = None, meaning: Sequence[int | None] | None = None
) -> UInt8[np.ndarray, "h w"]:
    """A class map: indices of the table, or 255 for none.

    Args:
        path: of the picture.
        classes: the table.
        key: what the map is of, for the error.
        meaning: the label of each number from 0 to 255 in the picture, None for one that must not occur; None where the numbers are labels.

    Raises:
        InputError: it is absent or damaged, or has a label outside the table.
    """
    labels = read_uint8(path)
    if meaning is not None:
        unknown = np.array([label is None for label in meaning])[labels]
        if unknown.any():
            number = int(labels[unknown][0])
            raise InputError(
                path, f"the numbers of table {classes.name}", f"{number} at {unknown.sum()} pixels", key=key
            )
        return np.array([label or 0 for label in meaning], dtype=np.uint8)[labels]
    outside = labels[(labels >= len(classes)) & (labels != IGNORE)]
    if outside.size:
        raise InputError(
            path,
            f"labels 0..{len(classes) - 1} of table {classes.name}, or {IGNORE} for none",
            f"{int(outside[0])} at {outside.size} pixels",
            key=key,
        )
    return labels
