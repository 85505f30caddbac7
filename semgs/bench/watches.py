"""Watches: what stands around the parts of a run to time them."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager

from semgs.bench.measure import WHOLE
from semgs.reconstruction.encode import now


class Stopwatch:
    """Seconds by part.

    On CUDA only the whole is looked at: to wait for the device between parts would change what is measured.

    Args:
        device: that computes.

    Attributes:
        seconds: by part.
    """

    def __init__(self, device: str = "cpu") -> None:
        self._device = device
        self.seconds: dict[str, float] = {}

    @contextmanager
    def __call__(self, part: str) -> Iterator[None]:
        """Around a part."""
        if self._device == "cuda" and part != WHOLE:
            yield
            return
        start = now()
        yield
        self.seconds[part] = now() - start
