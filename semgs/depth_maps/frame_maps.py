"""The depth maps that a scene itself has, as if they were from elsewhere: of unknown scale, or predicted by a network with the cameras."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import final

import torch
from jaxtyping import Float
from torch import Tensor

from semgs.data.frames import Frame
from semgs.data.resampling import Fit
from semgs.depth_maps.depth_source import Meaning
from semgs.files.errors import InputError
from semgs.segmenters.class_map_files import MadeBy

BOUNDS = (0.1, 10.0)
"""Near and far that a frame is read with for its depth alone, which does not depend on them."""


@final
@dataclass(frozen=True)
class FrameMaps:
    """The frames' own depth maps; `DepthMaps`.

    Attributes:
        meaning: what the numbers are.
    """

    meaning: Meaning = "scaled"

    @property
    def title(self) -> str:
        """In words."""
        return "the scene's own depth maps"

    @property
    def made_by(self) -> MadeBy | None:
        """Unknown."""
        return None

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
