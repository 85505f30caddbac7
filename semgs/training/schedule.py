"""The optimiser's schedule: how many steps, and how fast the weights change in each."""

from __future__ import annotations

import math
from dataclasses import dataclass

from semgs.training.setting_checks import check_values


@dataclass(frozen=True, kw_only=True)
class Schedule:
    """Steps of the optimiser (Adam) and of the moving average."""

    steps: int
    """Optimiser steps in the run. The learning rate reaches zero at the last one."""
    learning_rate: float = 2e-4
    """Peak learning rate of Adam; the paper's is 2e-4."""
    warmup: float = 0.01
    """Share of the steps in which the learning rate rises (MVSplat's OneCycle)."""
    clip: float = 0.5
    """Clip the gradient to this norm (MVSplat's)."""
    average_decay: float = 0.999
    """Decay of the moving average of the weights, which is what is validated and exported. It starts lower."""

    def __post_init__(self) -> None:
        check_values(
            self,
            steps=(self.steps >= 1, "at least 1"),
            learning_rate=(0 < self.learning_rate < math.inf, "a positive number"),
            warmup=(0 < self.warmup < 1, "a share between 0 and 1"),
            clip=(self.clip > 0, "a positive number"),
            average_decay=(0 <= self.average_decay < 1, "0 (no average) to below 1"),
        )

    def rate(self, step: int) -> float:
        """The learning rate of a step: half a cosine up from a 25th of the peak, then half a cosine down to nearly zero.

        This is Smith's one-cycle policy as MVSplat uses it (PyTorch's `OneCycleLR` without its momentum cycle). As a function of the
        step alone it has no state to save.
        """
        first, last = self.learning_rate / 25, self.learning_rate / 25e4
        top = max(self.warmup * self.steps - 1, 1e-9)
        if step <= top:
            return _cosine(first, self.learning_rate, step / top)
        return _cosine(self.learning_rate, last, min((step - top) / max(self.steps - 1 - top, 1e-9), 1))


def _cosine(start: float, end: float, share: float) -> float:
    """From start to end along half a cosine."""
    return end + (start - end) * (1 + math.cos(math.pi * share)) / 2
