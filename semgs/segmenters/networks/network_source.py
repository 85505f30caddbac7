"""Segmentation networks, and the distributions that they give the frames of a scene."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Protocol, final, runtime_checkable

import numpy as np
from jaxtyping import Bool, Float, Float32, UInt8
from torch import Tensor

from semgs.data.frames import Frame
from semgs.data.resampling import Fit
from semgs.data.tables.classes import ClassTable
from semgs.files.hashes import sha256_of
from semgs.segmenters.class_map_files import MadeBy, MapFiles, save_class_map
from semgs.segmenters.networks.cost import Cost, cost_of_photos
from semgs.segmenters.photo_maps import to_view


@runtime_checkable
class Segmenter(Protocol):
    """A network that gives every pixel of a single image a distribution over classes."""

    @property
    def classes(self) -> ClassTable:
        """The network's own table."""
        ...

    @property
    def made_by(self) -> MadeBy:
        """Which network it is."""
        ...

    def __call__(self, image: UInt8[np.ndarray, "h w 3"]) -> Float32[np.ndarray, "class rows columns"]:
        """The distribution over the classes, at any resolution; it covers the whole image and sums to 1.

        Args:
            image: RGB.
        """
        ...


@final
@dataclass(frozen=True)
class Photos:
    """What a network says about the undistorted photos of a scene, each at its own size.

    Attributes:
        segmenter: the network.
        save: folder to write its maps to; None for nowhere.
        earlier: maps from an earlier run of the same network, which are not computed again for the same photos; None if there are none.
    """

    segmenter: Segmenter
    save: Path | None = None
    earlier: MapFiles | None = field(default=None, repr=False)

    @property
    def title(self) -> str:
        """Name and licence of the network."""
        return self.segmenter.made_by.title

    @property
    def made_by(self) -> MadeBy:
        """The network."""
        return self.segmenter.made_by

    @property
    def classes(self) -> ClassTable:
        """The table of the network."""
        return self.segmenter.classes

    @property
    def known(self) -> Bool[np.ndarray, " class"]:
        """All of the table."""
        return np.ones(len(self.classes), bool)

    def of(self, frame: Frame, size: tuple[int, int], fit: Fit = "crop") -> Float[Tensor, "class h w"]:
        """The distribution over the network's classes of every pixel of a frame.

        Raises:
            InputError: the photo cannot be read, or an earlier map is damaged.
        """
        image = frame.read_undistorted()
        stored = self._stored(frame, image)
        if stored is not None and self.earlier is not None:
            found = self.earlier.probabilities(stored, frame)
        else:
            found = self.segmenter(image)
        if self.save is not None:
            save_class_map(self.save, frame, found, sha256_of(image))
        return to_view(found, frame, size, fit, undistorted=True)

    def cost(self, frames: Sequence[Frame]) -> Cost | None:
        """What the network takes for the frames without an earlier map: that of a grey image of the largest size, for each of them.

        Raises:
            InputError: the network cannot take the image, or a photo cannot be read.
        """
        left = [frame for frame in frames if self.earlier is None or not self._stored(frame, frame.read_undistorted())]
        return cost_of_photos(self.segmenter, left) if left else None

    def _stored(self, frame: Frame, image: UInt8[np.ndarray, "h w 3"]) -> Path | None:
        """The earlier map of a frame; None if there is none, or if the photo was another one then.

        Args:
            frame: the frame.
            image: its undistorted photo.
        """
        if self.earlier is None or self.earlier.photos.get(frame.name) != sha256_of(image):
            return None
        return self.earlier.path_of(frame)
