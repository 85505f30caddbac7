"""Images and depth of a file of predictions, as frames take them."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import ClassVar, final

import numpy as np
from jaxtyping import Float32

from semgs.data.cameras.lens import AbstractLens, carry_over
from semgs.data.maps import Pixels
from semgs.files.images.pictures import png_bytes


@final
@dataclass(frozen=True, eq=False)
class StoredImage:
    """A processed image as a PNG.

    Attributes:
        name: of the image, with its ending.
        pixels: uint8 [h w 3].
    """

    name: str
    pixels: np.ndarray = field(repr=False)
    suffix: ClassVar[str] = ".png"

    def is_file(self) -> bool:
        """True."""
        return True

    def read_bytes(self) -> bytes:
        """The PNG."""
        return png_bytes(self.pixels)

    def __str__(self) -> str:
        return self.name


@final
@dataclass(frozen=True, eq=False)
class PredictedDepth:
    """Predicted z-depths at the processed size: each pixel of the photo gets the depth that its ray hits, 0 where the photo was cropped.

    Attributes:
        values: z-depths [h w], 0 where unknown.
        lens: the camera of the processed image.
    """

    values: np.ndarray = field(repr=False)
    lens: AbstractLens
    stored: ClassVar[bool] = True

    def read(self, pixels: Pixels) -> Float32[np.ndarray, "h w"]:
        """As `MapSource.read`."""
        return pixels.taken(carry_over(self.values, self.lens, pixels.lens))
