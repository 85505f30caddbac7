"""Where the depth maps of frames come from, and what their numbers mean. The scene itself may have them."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Literal, Protocol, final, runtime_checkable

import torch
from jaxtyping import Float
from torch import Tensor

from semgs.data.frames import Frame
from semgs.data.resampling import Fit
from semgs.files.errors import InputError
from semgs.sources.source import BOUNDS, Source

Meaning = Literal["metric", "scaled", "inverse"]
"""What the numbers of a map are: z-depths in metres; z-depths up to one factor; or inverse z-depths up to one factor and an added constant, as MiDaS
and Depth Anything V2 predict them."""


@runtime_checkable
class DepthMaps(Source, Protocol):
    """Where the depth maps of frames come from."""

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


@final
@dataclass(frozen=True)
class FrameMaps(DepthMaps):
    """The frames' own depth maps.

    Attributes:
        meaning: what the numbers are.
    """

    meaning: Meaning = "scaled"

    @property
    def title(self) -> str:
        """In words."""
        return "the scene's own depth maps"

    def of(self, frame: Frame, size: tuple[int, int], fit: Fit = "crop") -> Float[Tensor, "h w"]:
        """As `DepthMaps.of`.

        Raises:
            InputError: as `DepthMaps.of`, or the frame has no depth map.
        """
        if frame.depth is None:
            raise InputError(frame.picture, "a depth map of this frame, as --depth maps needs", "none")
        depths = replace(frame, labels=None).view(BOUNDS, size=size, fit=fit).depths
        assert depths is not None
        return torch.where(depths[0] > 0, depths[0], torch.nan)
