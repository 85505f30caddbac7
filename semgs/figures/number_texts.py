"""Number formats of reports and summaries: two digits after the point, none for percentages."""

from __future__ import annotations

import math

UNKNOWN = "–"
"""Printed for an unknown number."""


def decibels(value: float | None) -> str:
    """A PSNR [dB]: "21.23 dB"; infinite is "equal"."""
    return UNKNOWN if value is None or math.isnan(value) else "equal" if value == math.inf else f"{value:.2f} dB"


def percent(share: float | None) -> str:
    """A share of 0..1: "12 %", or "under 1 %" for a small share above 0."""
    if share is None or math.isnan(share):
        return UNKNOWN
    return f"{100 * share:.0f} %" if share >= 0.01 or share == 0 else "under 1 %"


def duration(seconds: float) -> str:
    """Seconds: "1.50 s"."""
    return f"{seconds:.2f} s"


def length(value: float, metric: bool) -> str:
    """A length: "2.20 m"; three significant digits if the unit is unknown."""
    if math.isnan(value):
        return UNKNOWN
    return f"{value:.2f} m" if metric else f"{value:.3g}"
