"""Where something about every pixel of a scene's photos comes from, such as classes or depth; and what a network takes to run: time and memory, measured by running it."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from time import perf_counter
from typing import Protocol, runtime_checkable

import numpy as np
from jaxtyping import UInt8

from semgs.data.frames import Frame
from semgs.runtime.free_memory import process_bytes

MEGABYTE = 1e6

BOUNDS = (0.1, 10.0)
"""Near and far that a frame is read with for its maps alone, which do not depend on them."""


@dataclass(frozen=True)
class MadeBy:
    """Which network maps are from.

    Attributes:
        name: of the network: a file name or a hub id.
        digest: a hash of its weights.
        licence: of the network; "unknown" if it does not say.
        revision: the commit of the hub that it was; empty for files and folders. Another one with the same weights is the same network.
    """

    name: str
    digest: str
    licence: str = "unknown"
    revision: str = field(default="", compare=False)

    @property
    def title(self) -> str:
        """Name and licence."""
        return f"{self.name} (licence {self.licence})"

    @property
    def pinned(self) -> str:
        """The name; of a model of the hub with its commit, as hf:OWNER/NAME@COMMIT."""
        return f"{self.name.partition('@')[0]}@{self.revision}" if self.revision else self.name


@runtime_checkable
class Source(Protocol):
    """Where something about every pixel of a scene's photos comes from."""

    @property
    def title(self) -> str:
        """What it is, with its licence if that is known; by default its network."""
        assert self.made_by is not None
        return self.made_by.title

    @property
    def made_by(self) -> MadeBy | None:
        """The network that it comes from; None if that is unknown."""
        return None


@dataclass(frozen=True)
class Cost:
    """Time and memory of some work.

    Attributes:
        seconds: time.
        megabytes: memory beyond what was in use before, at most [10^6 bytes]; None if the system does not say.
    """

    seconds: float
    megabytes: float | None = None

    def times(self, count: int) -> Cost:
        """Of the same work several times, one after the other."""
        return Cost(count * self.seconds, self.megabytes)

    def __str__(self) -> str:
        """As part of a sentence."""
        memory = "" if self.megabytes is None else f" and at most {self.megabytes:.0f} MB more memory"
        return f"about {self.seconds:.1f} s{memory}"


@runtime_checkable
class Costly(Protocol):
    """A source that computes what it says."""

    def cost(self, frames: Sequence[Frame]) -> Cost | None:
        """What that of frames takes to compute; None if nothing needs to be computed.

        Raises:
            InputError: a frame cannot be used.
        """
        ...


def cost_of(source: object, frames: Sequence[Frame]) -> Cost | None:
    """What a source takes to compute for frames; None if nothing is computed.

    Raises:
        InputError: as `Costly.cost`.
    """
    return source.cost(frames) if isinstance(source, Costly) else None


def measured(work: Callable[[], object]) -> Cost:
    """The cost of some work, which is done once."""
    before, start = process_bytes("VmRSS"), perf_counter()
    work()
    seconds, peak = perf_counter() - start, process_bytes("VmHWM")
    return Cost(seconds, None if before is None or peak is None else (peak - before) / MEGABYTE)


def cost_of_photos(network: Callable[[UInt8[np.ndarray, "h w 3"]], object], frames: Sequence[Frame]) -> Cost:
    """The cost of a network for the photos of frames: that of a grey image of the largest size, for each of them.

    Raises:
        InputError: the network cannot take the image.
    """
    grey = np.full((*max((frame.lens.size for frame in frames), key=math.prod), 3), 128, np.uint8)
    return measured(lambda: network(grey)).times(len(frames))
