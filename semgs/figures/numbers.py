"""How pages and summaries print numbers: two digits after the point, and none in a percentage, which is as fine."""

from __future__ import annotations

import math

UNKNOWN = "–"
"""Stands for what there is no number of."""


def decibels(value: float | None) -> str:
    """A PSNR [dB]: "21.23 dB"; infinite is "equal"."""
    return UNKNOWN if value is None else "equal" if value == math.inf else f"{value:.2f} dB"


def percent(share: float | None) -> str:
    """A share of 0..1: "12 %", or "under 1 %" for little that is not nothing."""
    if share is None:
        return UNKNOWN
    return f"{100 * share:.0f} %" if share >= 0.01 or share == 0 else "under 1 %"


def duration(seconds: float) -> str:
    """Seconds: "1.50 s"."""
    return f"{seconds:.2f} s"


def length(value: float, metric: bool) -> str:
    """A length: "2.20 m"; in an unknown unit, which may be of any size, three significant digits."""
    return f"{value:.2f} m" if metric else f"{value:.3g}"
