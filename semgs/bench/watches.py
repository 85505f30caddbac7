"""Watches: what stands around the parts of a run to time them."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from time import perf_counter

import torch

from semgs.bench.measure import WHOLE


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
        start = self._now()
        yield
        self.seconds[part] = self._now() - start

    def _now(self) -> float:
        """The time at which all that was asked of the device is done."""
        if self._device == "cuda":
            torch.cuda.synchronize()
        return perf_counter()
