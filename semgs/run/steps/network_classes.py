"""Our network as a source of classes: what it says about each photo by itself."""

from __future__ import annotations

from dataclasses import dataclass
from typing import final

import numpy as np
import torch
from jaxtyping import Bool, Float
from torch import Tensor

from semgs.data.bounds.depth_range import INDOOR_DEPTH_RANGE
from semgs.data.frames import Frame
from semgs.data.resampling import Fit
from semgs.data.tables.classes import ClassTable
from semgs.model.semgs import SemGS
from semgs.segmenters.class_map_files import MadeBy


@final
@dataclass(frozen=True)
class NetworkClasses:
    """The classes of single photos from the semantic branch, a `semgs.segmenters.class_source.ClassSource`.

    Attributes:
        network: in evaluation mode.

    Raises:
        ValueError: the network has no classes.
    """

    network: SemGS

    def __post_init__(self) -> None:
        if self.network.classes is None:
            raise ValueError(
                f"{self.network.name} predicts colour only; expected a network with classes, or a segmenter"
            )

    @property
    def title(self) -> str:
        """Name of the network."""
        return self.network.name

    @property
    def made_by(self) -> MadeBy | None:
        """Nothing: weights carry their own card."""
        return None

    @property
    def classes(self) -> ClassTable:
        """The table of the network."""
        assert self.network.classes is not None
        return self.network.classes

    @property
    def known(self) -> Bool[np.ndarray, " class"]:
        """All of the table."""
        return np.ones(len(self.classes), bool)

    @torch.no_grad()
    def of(self, frame: Frame, size: tuple[int, int], fit: Fit = "crop") -> Float[Tensor, "class h w"]:
        """As `ClassSource.of`.

        Raises:
            InputError: the photo cannot be read.
        """
        view = frame.view(INDOOR_DEPTH_RANGE, size=size, fit=fit)  # by itself, classes do not depend on the range
        return self.network.classify(view.to(next(self.network.parameters()).device), alone=True)[0].cpu()
