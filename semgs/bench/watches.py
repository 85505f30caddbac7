"""Watches: what stands around the parts of a run to time them or to count their operations."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from time import perf_counter

import torch

from semgs.bench.flops import Counter, difference
from semgs.bench.measure import WHOLE


class Stopwatch:
    """Seconds by part, and with a counter the operations of each part.

    On CUDA only the whole is looked at: to wait for the device between parts would change what is measured.

    Args:
        device: that computes.
        counter: of operations, None to count none.

    Attributes:
        seconds: by part.
        operations: by part, then by kind.
    """

    def __init__(self, device: str = "cpu", counter: Counter | None = None) -> None:
        self._device = device
        self._counter = counter
        self.seconds: dict[str, float] = {}
        self.operations: dict[str, dict[str, float]] = {}

    @contextmanager
    def __call__(self, part: str) -> Iterator[None]:
        """Around a part."""
        if self._device == "cuda" and part != WHOLE:
            yield
            return
        before = self._counter.read() if self._counter else None
        start = self._now()
        yield
        self.seconds[part] = self._now() - start
        if self._counter and before:
            self.operations[part] = difference(self._counter.read(), before)

    def _now(self) -> float:
        """The time at which all that was asked of the device is done."""
        if self._device == "cuda":
            torch.cuda.synchronize()
        return perf_counter()
