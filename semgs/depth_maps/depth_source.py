"""Where the depth maps of frames come from, and what their numbers mean."""

from __future__ import annotations

from typing import Literal, Protocol, runtime_checkable

from jaxtyping import Float
from torch import Tensor

from semgs.data.frames import Frame
from semgs.data.resampling import Fit
from semgs.segmenters.class_map_files import MadeBy

Meaning = Literal["metric", "scaled", "inverse"]
"""What the numbers of a map are: z-depths in metres; z-depths up to one factor; or inverse z-depths up to one factor and an added constant, as MiDaS
and Depth Anything V2 predict them."""


@runtime_checkable
class DepthMaps(Protocol):
    """Where the depth maps of frames come from."""

    @property
    def title(self) -> str:
        """What it is, with its licence if that is known."""
        ...

    @property
    def made_by(self) -> MadeBy | None:
        """The network that predicts them; None if that is unknown."""
        ...

    @property
    def meaning(self) -> Meaning:
        """What the numbers are."""
        ...

    def of(self, frame: Frame, size: tuple[int, int], fit: Fit = "crop") -> Float[Tensor, "h w"]:
        """The map at every pixel of a frame, as `Scene.read` reads it with that size and fit; NaN where nothing is known.

        Raises:
            InputError: a file is missing, damaged or does not belong to the frame, or a network cannot take the photo.
        """
        ...
