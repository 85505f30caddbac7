"""Times the parts of a run."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager

from paper.bench.measure import WHOLE
from semgs.runtime.stopwatch import now


class Stopwatch:
    """Seconds by part.

    On CUDA only `WHOLE` is timed: waiting for the device between parts would change the result.

    Args:
        device: "cpu" or "cuda".

    Attributes:
        seconds: by part.
    """

    def __init__(self, device: str = "cpu") -> None:
        self._device = device
        self.seconds: dict[str, float] = {}

    @contextmanager
    def __call__(self, part: str) -> Iterator[None]:
        """Time a part."""
        if self._device == "cuda" and part != WHOLE:
            yield
            return
        start = now()
        yield
        self.seconds[part] = now() - start
