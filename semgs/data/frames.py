"""Frames: one posed picture of a scene on disk, and how its pixels become a view."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from functools import lru_cache
from typing import final

import numpy as np
import torch
from jaxtyping import Float32, UInt8

from semgs.data.classes import IGNORE, SCANNET20, ClassTable
from semgs.data.lens import AbstractLens
from semgs.data.maps import MapSource, Pixels
from semgs.data.resampling import reframed, resized
from semgs.data.views import Views
from semgs.files.pictures import read_rgb
from semgs.files.stored import Stored
from semgs.geometry.cameras import Cameras


@final
@dataclass(frozen=True, eq=False)
class Frame:
    """One picture of a scene with what the scene's file says about it; nothing is decoded yet.

    Attributes:
        name: as listed in the scene's file ("images/0001.jpg").
        picture: where it is: a file, or what stands for one in an archive or a recording.
        lens: the camera that took it, distortion included.
        world_from_camera: pose [4 4], float64, OpenCV axes [m, or the scene's unit].
        depth: where its z-depths come from; None if it has none.
        labels: where its labels come from; None if it has none.
        mask: where it is hidden: there is neither label nor depth there. None if nothing is.
        points: which of the scene's sparse points it sees (indices), or None where the layout has none.
    """

    name: str
    picture: Stored
    lens: AbstractLens
    world_from_camera: np.ndarray
    depth: MapSource | None = None
    labels: MapSource | None = None
    mask: MapSource | None = None
    points: np.ndarray | None = field(default=None, repr=False)

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
    ) -> Views:
        """As `view`, every number checked.

        Raises:
            InputError, ImportError: as `view`.
            ValueError: as `Views`.
        """
        return self.view(depth_range, classes, size=size, crop=crop).checked()

    def view(
        self,
        depth_range: tuple[float, float],
        classes: ClassTable | None = None,
        *,
        size: Sequence[int] | None = None,
        crop: bool = False,
    ) -> Views:
        """The frame as one view, distortion undone, trusted: callers join several and check them together.

        Args:
            depth_range: near and far to give the view.
            classes: the table of its labels; None leaves labels out.
            size: (height, width) to resize to, as `semgs.data.resampling.resized`; None leaves the picture at its own size.
            crop: where the size has another aspect, crop to it, as `semgs.data.resampling.reframed`; else the picture is stretched.

        Raises:
            InputError: a file is absent, damaged, or of another size than the camera; a label is outside the table.
            ImportError: labels or depth are cast at a mesh, and embreex or trimesh is not installed.
        """
        image, maps = self.read_image(), _maps(self.lens)
        if maps is not None:
            image = self.lens.undistorted(image, maps)
        view = Views.trusted(
            images=torch.from_numpy(image).permute(2, 0, 1)[None].float() / 255,
            cameras=Cameras(self.world_from_camera[None], self.lens.intrinsics[None], self.lens.size),
            depth_range=torch.tensor([depth_range], dtype=torch.float64),
            classes=classes or SCANNET20,
        )
        if size is not None:
            view = (reframed if crop else resized)(view, size)
        pixels = Pixels(self.lens, view.cameras[0], maps, crop)
        depths = None if self.depth is None else torch.from_numpy(self.depth.read(pixels))[None]
        labels = None if self.labels is None or classes is None else torch.from_numpy(self.labels.read(pixels))[None]
        if self.mask is not None:
            hidden = torch.from_numpy(self.mask.read(pixels))[None]
            depths = None if depths is None else depths.masked_fill(hidden, 0)
            labels = None if labels is None else labels.masked_fill(hidden, IGNORE)
        return view.changed(labels=labels, depths=depths)

    def read_image(self) -> UInt8[np.ndarray, "h w 3"]:
        """The picture as it is stored, RGB.

        Raises:
            InputError: it is absent, damaged, or of another size than the camera.
        """
        return read_rgb(self.picture, self.lens.size)

    def measured(self) -> Float32[np.ndarray, "h w"] | None:
        """The z-depths that a file holds [m], distortion undone, 0 where unknown; None if there is no such file.

        Raises:
            InputError: it is damaged, or has another aspect than the picture.
        """
        if self.depth is None or not self.depth.stored:
            return None
        return self.depth.read(Pixels(self.lens, self.camera, _maps(self.lens)))


@lru_cache(maxsize=2)
def _maps(lens: AbstractLens) -> tuple[np.ndarray, np.ndarray] | None:
    """What undoes the distortion of a lens, None for a pinhole; kept, for most frames of a scene have the same lens."""
    return None if lens.is_pinhole else lens.maps()
