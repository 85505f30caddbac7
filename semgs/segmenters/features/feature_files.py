"""Feature maps in files, from whatever network looked at the photos.

    DIR/color/0.npy             features of the photo color/0.jpg [numbers height width], any floating-point type, or
    DIR/color/0.npz             the same, compressed; one array
    DIR/0.npy, DIR/0.npz        the same, if no other frame of the scene has that file name without its ending

A map covers the whole photo as it is stored, distortion included. It may be as small as a grid of patches. Features are compared by their
cosine, so their lengths do not matter. A feature of zeros says nothing.
"""

from __future__ import annotations

from collections import Counter
from dataclasses import dataclass
from pathlib import Path
from typing import final

import numpy as np
from jaxtyping import Float

from semgs.data.frames import Frame
from semgs.data.maps import ASPECT_TOLERANCE
from semgs.data.scene import Scene
from semgs.files.errors import InputError
from semgs.files.paths import found_at
from semgs.sources.photo_maps import needed_file, only_array, stems_of

MOST_NUMBERS = 4096
"""Numbers of a feature, at most: principal components take the cube of them."""


@final
@dataclass(frozen=True)
class FeatureFiles:
    """A folder of feature maps for the frames of one scene.

    Attributes:
        folder: contains them.
        stems: as from `semgs.sources.photo_maps.stems_of`.
    """

    folder: Path
    stems: Counter[str]

    @classmethod
    def opened(cls, folder: Path, scene: Scene) -> FeatureFiles:
        """The maps in a folder.

        Raises:
            InputError: there is no such folder, or two frames would share a map.
        """
        if not folder.is_dir():
            raise InputError(folder, "a folder of feature maps", found_at(folder))
        return cls(folder, stems_of(scene))

    @property
    def title(self) -> str:
        """The folder."""
        return str(self.folder)

    def of(self, frame: Frame) -> Float[np.ndarray, "n rows columns"]:
        """The features of a frame's photo, as they are stored.

        Raises:
            InputError: there is no map of the frame, or it is damaged, has another aspect than the photo, or too many numbers, or one that
                is not finite.
        """
        expected = "one array of features [numbers height width] of a floating-point type"
        path = needed_file(self.folder, frame, self.stems, (".npy", ".npz"), "the features")
        values = only_array(path, expected)
        if values.ndim != 3 or min(values.shape) < 1 or values.dtype.kind != "f":
            raise InputError(path, expected, f"{values.shape} of {values.dtype}")
        if values.shape[0] > MOST_NUMBERS:
            raise InputError(path, f"features of at most {MOST_NUMBERS} numbers", f"{values.shape[0]}")
        (height, width), (rows, columns) = frame.lens.size, values.shape[1:]
        # A grid of patches has whole numbers of rows and columns, so its aspect is only about right.
        tolerance = max(ASPECT_TOLERANCE, 1 / min(rows, columns))
        if abs(rows * width / (columns * height) - 1) > tolerance:
            raise InputError(path, f"the aspect of its photo, {width}x{height} (width x height)", f"{columns}x{rows}")
        for channel, plane in enumerate(values):  # one at a time, as maps are large
            if not np.isfinite(plane).all():
                raise InputError(path, "finite numbers", "NaN or infinity", key=f"[{channel}]")
        return values
