"""What a network takes to run: time and memory, measured by running it."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path
from time import perf_counter
from typing import Protocol, runtime_checkable

from semgs.data.frames import Frame

MEGABYTE = 1e6


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
    """A source of class distributions that computes them."""

    def cost(self, frames: Sequence[Frame]) -> Cost | None:
        """What those of frames take to compute; None if nothing needs to be computed.

        Raises:
            InputError: a frame cannot be used.
        """
        ...


def cost_of(source: object, frames: Sequence[Frame]) -> Cost | None:
    """What a source's distributions of frames take to compute; None if nothing is computed.

    Raises:
        InputError: as `Costly.cost`.
    """
    return source.cost(frames) if isinstance(source, Costly) else None


def measured(work: Callable[[], object]) -> Cost:
    """The cost of some work, which is done once."""
    before, start = _of_process("VmRSS"), perf_counter()
    work()
    seconds, peak = perf_counter() - start, _of_process("VmHWM")
    return Cost(seconds, None if before is None or peak is None else peak - before)


def _of_process(key: str) -> float | None:
    """Memory of this process [10^6 bytes]: in use (VmRSS), or the most since its start (VmHWM); None if Linux does not say."""
    try:
        lines = Path("/proc/self/status").read_text(encoding="ascii").splitlines()
        return next(int(line.split()[1]) * 1024 / MEGABYTE for line in lines if line.startswith(f"{key}:"))
    except (OSError, StopIteration):
        return None
