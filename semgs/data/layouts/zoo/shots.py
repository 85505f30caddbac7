"""Images, depth and labels of single frames, read with scenezoo."""

from __future__ import annotations

import io
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any, ClassVar, final

import numpy as np
from jaxtyping import Float32, UInt8
from PIL import Image

from semgs.data.cameras.lens import Lens, carry_over
from semgs.data.layouts.zoo.scenezoo_library import scenezoo_errors
from semgs.data.maps import Pixels, fit_to_image
from semgs.data.tables.nyu40 import NAMES, scannet20_labels
from semgs.files.errors import InputError


@final
@dataclass(frozen=True, eq=False)
class ZooFrame:
    """One frame of a data set.

    Attributes:
        opened: scenezoo's data set.
        path: the folder of the data set, for errors.
        scene: scenezoo's name of the scene.
        index: scenezoo's number of the frame.
        keywords: what else scenezoo needs to know: the camera, or the room.
    """

    opened: Any
    path: Path
    scene: str
    index: int
    keywords: Mapping[str, str]
    suffix: ClassVar[str] = ".png"

    @property
    def name(self) -> str:
        """A name for errors."""
        return f"{self.scene} {self.index}"

    def __str__(self) -> str:
        return f"{self.path}: {self.name}"

    def is_file(self) -> bool:
        """Whether scenezoo lists it."""
        return True

    def read_bytes(self) -> bytes:
        """The image as PNG.

        Raises:
            InputError: scenezoo cannot read it.
        """
        file = io.BytesIO()
        Image.fromarray(self.item("rgb")).save(file, "PNG", compress_level=0)
        return file.getvalue()

    def item(self, name: str) -> np.ndarray:
        """One of scenezoo's items of this frame.

        Raises:
            InputError: scenezoo cannot read it.
        """
        with scenezoo_errors(self.path):
            batch = self.opened.get_frames(
                self.scene, indices=[self.index], items=(name,), rotate_to_up=False, **self.keywords
            )
        if batch.depth_mode == "ray_distance":
            raise InputError(self.path, "depth along the optical axis", "depth along rays", self.name)
        return np.asarray(getattr(batch, name)[0])


@final
@dataclass(frozen=True, eq=False)
class ZooDepth:
    """Z-depths of a frame.

    Attributes:
        shot: the frame.
        lens: of the depth camera; None for that of the image, perhaps at another size.
        confidence: whether there is a map of how reliable it is.
    """

    shot: ZooFrame
    lens: Lens | None = None
    confidence: bool = False
    stored: ClassVar[bool] = True

    def read(self, pixels: Pixels) -> Float32[np.ndarray, "h w"]:
        """As `MapSource.read`.

        Raises:
            InputError: as `MapSource.read`.
        """
        depths = self.shot.item("depth").astype(np.float32)
        if self.confidence:
            depths = np.where(self.shot.item("confidence_maps") == 0, np.float32(0), depths)
        if self.lens is not None:
            return pixels.taken(carry_over(depths, self.lens, pixels.lens))
        return pixels.taken(fit_to_image(self.shot, depths, pixels.lens.size))


@final
@dataclass(frozen=True, eq=False)
class ZooLabels:
    """NYU40 labels of a frame.

    Attributes:
        shot: the frame.
    """

    shot: ZooFrame
    stored: ClassVar[bool] = True

    def read(self, pixels: Pixels) -> UInt8[np.ndarray, "h w"]:
        """As `MapSource.read`.

        Raises:
            InputError: as `MapSource.read`.
        """
        ids = self.shot.item("semantic_maps").astype(np.int64)
        labels = scannet20_labels()[np.where((ids < 0) | (ids > len(NAMES)), 0, ids)]
        return pixels.taken(fit_to_image(self.shot, labels, pixels.lens.size))
