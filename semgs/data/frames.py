"""Frames: one posed image of a scene on disk, and how it becomes a view."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from functools import lru_cache
from typing import final

import numpy as np
import torch
from jaxtyping import Bool, Float32, Int32, UInt8

from semgs.data.borders import find_border
from semgs.data.cameras.lens import AbstractLens
from semgs.data.maps import MapSource, Pixels
from semgs.data.resampling import Fit, reframed, resized
from semgs.data.tables.classes import IGNORE, SCANNET20, ClassTable
from semgs.data.views import Views
from semgs.files.errors import InputError
from semgs.files.images.pictures import read_rgb
from semgs.files.stored import Stored
from semgs.geometry.cameras import Cameras, writable


@final
@dataclass(frozen=True, eq=False)
class Frame:
    """One image of a scene, with what the scene's files say about it; nothing is decoded yet.

    Attributes:
        name: as listed in the scene's file ("images/0001.jpg").
        picture: the image: a file, or a part of an archive or recording.
        lens: the camera, including distortion.
        world_from_camera: pose [4 4], float64, OpenCV axes [m, or the scene's unit].
        depth: source of its z-depths; None if it has none.
        labels: source of its labels; None if it has none.
        mask: source of its hidden pixels (`Views.hidden`) besides black borders, which are found in the image; None if it has none.
        points: indices of the scene's sparse points that it sees; None if the layout does not say.
        instances: source of the numbers of its things; None if it has none.
    """

    name: str
    picture: Stored
    lens: AbstractLens
    world_from_camera: np.ndarray
    depth: MapSource | None = None
    labels: MapSource | None = None
    mask: MapSource | None = None
    points: np.ndarray | None = field(default=None, repr=False)
    instances: MapSource | None = None

    @property
    def camera(self) -> Cameras:
        """The camera of the undistorted image, at its full size."""
        return Cameras(self.world_from_camera, self.lens.intrinsics, self.lens.size)

    def view(
        self,
        depth_range: tuple[float, float],
        classes: ClassTable | None = None,
        *,
        size: Sequence[int] | None = None,
        fit: Fit = "stretch",
    ) -> Views:
        """The frame as one undistorted view, not checked: callers join several views and check them together.

        Args:
            depth_range: near and far of the view.
            classes: the table of its labels; None to leave labels out.
            size: (height, width) to resize to; None keeps the full size.
            fit: what is done if the size has another aspect.

        Raises:
            InputError: a file is missing or damaged, or has another size than the camera; a label is outside the table; all pixels are
                hidden.
            ImportError: labels or depth come from a mesh, and embreex or trimesh is not installed.
        """
        image = self.read_undistorted()
        hidden = self._hidden(image)
        view = Views.trusted(
            images=torch.from_numpy(image).permute(2, 0, 1)[None].float() / 255,
            cameras=Cameras(self.world_from_camera[None], self.lens.intrinsics[None], self.lens.size),
            depth_range=torch.tensor([depth_range], dtype=torch.float64),
            classes=classes or SCANNET20,
            hidden=None if hidden is None else torch.from_numpy(hidden)[None],
        )
        if size is not None:
            view = (reframed if fit == "crop" else resized)(view, size)
        pixels = Pixels(self.lens, view.cameras[0], undistortion(self.lens), fit == "crop")
        depths = None if self.depth is None else torch.from_numpy(writable(self.depth.read(pixels)))[None]
        labels = (
            None
            if self.labels is None or classes is None
            else torch.from_numpy(writable(self.labels.read(pixels)))[None]
        )
        if view.hidden is not None:
            if view.hidden.all():
                raise InputError(self.picture, "an image of which some pixels are visible", "all are masked or black")
            depths = None if depths is None else depths.masked_fill(view.hidden, 0)
            labels = None if labels is None else labels.masked_fill(view.hidden, IGNORE)
        return view.changed(labels=labels, depths=depths)

    def things(self, view: Views, fit: Fit = "stretch") -> Int32[np.ndarray, "h w"] | None:
        """The number of the thing at each pixel of this frame as a view, 0 for none; None if nothing says it.

        Args:
            view: the frame as it was read.
            fit: what was done if its size has another aspect.

        Raises:
            InputError: a file is missing or damaged, or has another aspect than the image.
        """
        if self.instances is None:
            return None
        return self.instances.read(Pixels(self.lens, view.cameras[0], undistortion(self.lens), fit == "crop"))

    def read_image(self) -> UInt8[np.ndarray, "h w 3"]:
        """The stored image, RGB.

        Raises:
            InputError: it is missing or damaged, or has another size than the camera.
        """
        return read_rgb(self.picture, self.lens.size)

    def read_undistorted(self) -> UInt8[np.ndarray, "h w 3"]:
        """The image as a pinhole camera sees it, RGB, at its full size.

        Raises:
            InputError: as `read_image`.
        """
        image, maps = self.read_image(), undistortion(self.lens)
        return image if maps is None else self.lens.undistorted(image, maps)

    def _hidden(self, image: UInt8[np.ndarray, "h w 3"]) -> Bool[np.ndarray, "h w"] | None:
        """The hidden pixels of the undistorted image: a black border, what undistortion leaves empty, and the mask; None if there are none."""
        maps = undistortion(self.lens)
        found = [
            find_border(image),
            None if maps is None else self.lens.empty(maps),
            None if self.mask is None else self.mask.read(Pixels(self.lens, self.camera, maps)),
        ]
        parts = [part for part in found if part is not None and part.any()]
        return np.logical_or.reduce(parts) if parts else None

    def measured(self) -> Float32[np.ndarray, "h w"] | None:
        """The undistorted z-depths from a file [m], 0 where unknown; None if there is no depth file.

        Raises:
            InputError: it is damaged, or has another aspect than the image.
        """
        if self.depth is None or not self.depth.stored:
            return None
        return self.depth.read(Pixels(self.lens, self.camera, undistortion(self.lens)))


@lru_cache(maxsize=2)
def undistortion(lens: AbstractLens) -> tuple[np.ndarray, np.ndarray] | None:
    """The undistortion maps of a lens, None for a pinhole. Cached, as most frames of a scene have the same lens."""
    return None if lens.is_pinhole else lens.maps()
