"""Frames: one posed picture of a scene on disk, and how its pixels become a view."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field

import numpy as np
import torch
from jaxtyping import Float32, UInt8

from semgs.data.classes import IGNORE, SCANNET20, ClassTable
from semgs.data.lens import Lens
from semgs.data.resampling import reframed, resized
from semgs.data.views import Views
from semgs.files.arrays import read_array
from semgs.files.errors import InputError
from semgs.files.pictures import read_rgb, read_uint8, read_uint16
from semgs.files.stored import Stored
from semgs.geometry.cameras import Cameras

ASPECT_TOLERANCE = 0.02
"""Depth and label maps may be smaller than their picture, as phones' are, if their aspect is the same to this fraction."""

SATURATED = 65535
"""The largest count of a 16-bit depth map: nothing was measured, or something beyond. Unknown, as 0 is."""


@dataclass(frozen=True, eq=False)
class Frame:
    """One picture of a scene with what the scene's file says about it; nothing is decoded yet.

    A layout whose pictures or maps are stored in another way derives from it and replaces `read_image`, `read_depths` or `read_labels`.

    Attributes:
        name: as listed in the scene's file ("images/0001.jpg").
        picture_path: where it is: a file, or what stands for one in an archive or a recording.
        lens: the camera that took it, distortion included.
        world_from_camera: pose [4 4], float64, OpenCV axes [m, or the scene's unit].
        depth_path: z-depth map, 16-bit PNG or PGM, or .npy, or whatever holds or yields it; None where there is none.
        depth_unit: what one count of the depth map is worth [m].
        label_path: class map, 8-bit PNG, or whatever holds or yields it; None where there is none.
        points: which of the scene's sparse points it sees (indices), or None where the layout has none.
        meaning: of each number from 0 to 255 in the class map, as `LabelSet.meaning`; None where they are labels already.
    """

    name: str
    picture_path: Stored
    lens: Lens
    world_from_camera: np.ndarray
    depth_path: Stored | None = None
    depth_unit: float = 0.001
    label_path: Stored | None = None
    points: np.ndarray | None = field(default=None, repr=False)
    meaning: tuple[int | None, ...] | None = field(default=None, repr=False)

    @property
    def camera(self) -> Cameras:
        """The camera of the picture as it is read: without distortion, at the picture's own size."""
        return Cameras(self.world_from_camera, self.lens.intrinsics, self.lens.size)

    def read(
        self,
        depth_range: tuple[float, float],
        classes: ClassTable | None = None,
        *,
        size: Sequence[int] | None = None,
        crop: bool = False,
        maps: tuple[np.ndarray, np.ndarray] | None = None,
    ) -> Views:
        """The frame as one view, distortion undone, every number checked.

        Args:
            depth_range: near and far to give the view.
            classes: the table of its labels; None leaves labels out.
            size: (height, width) to resize to, as `semgs.data.resampling.resized`; None leaves the picture at its own size.
            crop: where the size has another aspect, crop to it, as `semgs.data.resampling.reframed`; else the picture is stretched.
            maps: what `lens.maps()` gives, for a caller who reads several frames of one lens.

        Raises:
            InputError: a file is absent, damaged, or of another size than the camera; a label is outside the table.
            ValueError: as `Views`.
        """
        return self.view(depth_range, classes, size=size, crop=crop, maps=maps).checked()

    def view(
        self,
        depth_range: tuple[float, float],
        classes: ClassTable | None = None,
        *,
        size: Sequence[int] | None = None,
        crop: bool = False,
        maps: tuple[np.ndarray, np.ndarray] | None = None,
    ) -> Views:
        """As `read`, but trusted: for those that join several frames and check them together.

        Raises:
            InputError: as `read`.
        """
        image, depths = self.read_image(), self.read_depths()
        labels = None if classes is None else self.read_labels(classes)
        if not self.lens.is_pinhole:
            maps = self.lens.maps() if maps is None else maps
            image = self.lens.undistorted(image, maps)
            depths = None if depths is None else self.lens.undistorted(depths, maps, nearest=True)
            labels = None if labels is None else self.lens.undistorted(labels, maps, nearest=True)
        view = Views.trusted(
            images=torch.from_numpy(image).permute(2, 0, 1)[None].float() / 255,
            cameras=Cameras(self.world_from_camera[None], self.lens.intrinsics[None], self.lens.size),
            depth_range=torch.tensor([depth_range], dtype=torch.float64),
            labels=None if labels is None else torch.from_numpy(labels)[None],
            depths=None if depths is None else torch.from_numpy(depths)[None],
            classes=classes or SCANNET20,
        )
        return view if size is None else (reframed if crop else resized)(view, size)

    def read_image(self) -> UInt8[np.ndarray, "h w 3"]:
        """The picture as it is stored, RGB.

        Raises:
            InputError: it is absent, damaged, or of another size than the camera.
        """
        return read_rgb(self.picture_path, self.lens.size)

    def read_depths(self) -> Float32[np.ndarray, "h w"] | None:
        """The z-depth of each pixel as stored [m], 0 where unknown; None where the frame has none.

        Raises:
            InputError: the map is absent, damaged, of another type, or has another aspect than the picture.
        """
        return None if self.depth_path is None else self.fitted(self.depth_path, self.depth_map(self.depth_path))

    def depth_map(self, path: Stored) -> Float32[np.ndarray, "rows columns"]:
        """A depth map at its own size [m], 0 where unknown.

        Raises:
            InputError: it is absent, damaged or of another type.
        """
        if path.suffix.lower() == ".npy":
            counts = read_array(path)
            if counts.ndim != 2:
                raise InputError(path, "an array [height width] of numbers", f"{counts.shape}")
        else:
            counts = read_uint16(path)
        depths = counts.astype(np.float32) * np.float32(self.depth_unit)
        depths[~np.isfinite(depths) | (depths < 0)] = 0
        if counts.dtype == np.uint16:
            depths[counts == SATURATED] = 0
        return depths

    def read_labels(self, classes: ClassTable) -> UInt8[np.ndarray, "h w"] | None:
        """The class of each pixel as stored, 255 = none; None where the frame has no class map.

        Raises:
            InputError: the map is absent, damaged, of another aspect than the picture, or has a label outside the table.
        """
        if self.label_path is None:
            return None
        labels = read_labels(self.label_path, classes, f"frame {self.name}", self.meaning)
        return self.fitted(self.label_path, labels)

    def fitted(self, path: Stored, values: np.ndarray) -> np.ndarray:
        """A map at the picture's size, each pixel from the one that its centre lies in.

        Raises:
            InputError: its aspect is not the picture's.
        """
        (height, width), (rows, columns) = self.lens.size, values.shape
        if (rows, columns) == (height, width):
            return values
        if not rows or not columns or abs(rows * width / (columns * height) - 1) > ASPECT_TOLERANCE:
            raise InputError(path, f"{width}x{height} pixels (width x height), as its picture", f"{columns}x{rows}")
        row = (2 * np.arange(height) + 1) * rows // (2 * height)
        column = (2 * np.arange(width) + 1) * columns // (2 * width)
        return np.ascontiguousarray(values[row[:, None], column])


def read_labels(
    path: Stored, classes: ClassTable, key: str, meaning: Sequence[int | None] | None = None
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
