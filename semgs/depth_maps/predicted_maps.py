"""Monocular depth networks, and the maps that they predict for the frames of a scene."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Protocol, final, runtime_checkable

import numpy as np
import torch
from jaxtyping import Float, Float32, UInt8
from torch import Tensor

from semgs.data.frames import Frame
from semgs.data.resampling import Fit
from semgs.depth_maps.depth_source import Meaning
from semgs.geometry.cameras import writable
from semgs.segmenters.class_map_files import MadeBy
from semgs.segmenters.networks.cost import Cost, cost_of_photos
from semgs.segmenters.photo_maps import resampled


@runtime_checkable
class DepthNetwork(Protocol):
    """A network that predicts the depth of every pixel of a single image."""

    @property
    def made_by(self) -> MadeBy:
        """Which network it is."""
        ...

    @property
    def meaning(self) -> Meaning:
        """What its numbers are."""
        ...

    @property
    def prompted(self) -> bool:
        """Whether it takes the depth of a sensor beside the image."""
        ...

    def __call__(
        self, image: UInt8[np.ndarray, "h w 3"], prompt: Float32[np.ndarray, "h w"] | None = None
    ) -> Float32[np.ndarray, "rows columns"]:
        """The map, at any resolution; it covers the whole image.

        Args:
            image: RGB.
            prompt: z-depths that a sensor measured, 0 where it measured nothing [m]; only for prompted networks.
        """
        ...


@final
@dataclass(frozen=True)
class PredictedMaps:
    """What a network predicts for the undistorted photos of a scene, each at its own size; `DepthMaps`.

    Attributes:
        network: the network.
    """

    network: DepthNetwork

    @property
    def title(self) -> str:
        """Name and licence of the network."""
        return self.network.made_by.title

    @property
    def made_by(self) -> MadeBy | None:
        """The network."""
        return self.network.made_by

    @property
    def meaning(self) -> Meaning:
        """What the numbers are."""
        return self.network.meaning

    def of(self, frame: Frame, size: tuple[int, int], fit: Fit = "crop") -> Float[Tensor, "h w"]:
        """As `DepthMaps.of`.

        Raises:
            InputError: the photo cannot be read, or the network cannot take it.
        """
        prompt = frame.measured() if self.network.prompted else None
        values = torch.from_numpy(writable(self.network(frame.read_undistorted(), prompt)))[None]
        return resampled(values, frame, size, fit, undistorted=True)[0]

    def cost(self, frames: Sequence[Frame]) -> Cost | None:
        """As `cost_of_photos`; a prompted network gets a wall at 1 m."""
        network = self.network
        return cost_of_photos(
            lambda image: network(image, np.ones(image.shape[:2], np.float32) if network.prompted else None), frames
        )
