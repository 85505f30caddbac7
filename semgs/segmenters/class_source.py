"""Where the class distributions of frames come from."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Protocol, final, runtime_checkable

import numpy as np
import torch
from jaxtyping import Bool, Float, Float32, UInt8
from torch import Tensor

from semgs.data.frames import Frame
from semgs.data.resampling import Fit
from semgs.data.scene import Scene
from semgs.data.tables.classes import ClassTable
from semgs.geometry.cameras import checked_size
from semgs.segmenters.names import Correspondence
from semgs.sources.source import Cost, MadeBy, Source, cost_of


@runtime_checkable
class ClassSource(Source, Protocol):
    """Where the class distributions of frames come from."""

    @property
    def classes(self) -> ClassTable:
        """The table of the distributions."""
        ...

    @property
    def known(self) -> Bool[np.ndarray, " class"]:
        """The classes of the table that it can say: all, if it does not say otherwise."""
        return np.ones(len(self.classes), bool)

    def of(self, frame: Frame, size: tuple[int, int], fit: Fit = "crop") -> Float[Tensor, "class h w"]:
        """The distribution over the classes of every pixel of a frame, as `Scene.read` reads it with that size and fit.

        Raises:
            InputError: a file is missing, damaged or does not belong to the frame.
        """
        ...


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
class Translated(ClassSource):
    """A source in another class table.

    Attributes:
        source: in its own table.
        correspondence: from its classes to others.
    """

    source: ClassSource
    correspondence: Correspondence

    @property
    def title(self) -> str:
        """That of the source."""
        return self.source.title

    @property
    def made_by(self) -> MadeBy | None:
        """That of the source."""
        return self.source.made_by

    @property
    def classes(self) -> ClassTable:
        """The table that the correspondence leads to."""
        return self.correspondence.classes

    @property
    def known(self) -> Bool[np.ndarray, " class"]:
        """The classes that something of the source's table means."""
        return self.correspondence.table[self.source.known].sum(0) > 0

    def of(self, frame: Frame, size: tuple[int, int], fit: Fit = "crop") -> Float[Tensor, "class h w"]:
        """As `ClassSource.of`.

        Raises:
            InputError: as `ClassSource.of`.
        """
        return self.correspondence(self.source.of(frame, size, fit))

    def cost(self, frames: Sequence[Frame]) -> Cost | None:
        """As `Costly.cost`.

        Raises:
            InputError: as `ClassSource.of`.
        """
        return cost_of(self.source, frames)


def notes_of(source: ClassSource) -> tuple[str, ...]:
    """What the user should know about a source, a sentence each: which of its class names are unknown."""
    if not isinstance(source, Translated) or not source.correspondence.unknown:
        return ()
    unknown, names = source.correspondence.unknown, source.source.classes.names
    return (
        f"{len(unknown)} of the {len(names)} class names of {source.title} are unknown, so they say nothing about the scene's "
        f"classes: {', '.join(unknown)}.",
    )


def read_distributions(
    source: ClassSource, scene: Scene, positions: Sequence[int], size: Sequence[int], fit: Fit = "crop"
) -> Float[Tensor, "v class h w"]:
    """What a source says about frames of a scene, one frame after the other; size and fit are as for `Scene.read`.

    Raises:
        InputError: as `ClassSource.of`.
    """
    height, width = checked_size(size)
    return torch.stack([source.of(scene.frames[position], (height, width), fit) for position in positions])
