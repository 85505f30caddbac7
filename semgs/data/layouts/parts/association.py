"""Association by time: which entries of two streams belong together, as in TUM RGB-D's own tool."""

from __future__ import annotations

import numpy as np

TOLERANCE = 0.02
"""Largest time difference of associated entries [s]: TUM RGB-D's default."""


NEAREST = 25
"""So many entries before one, and so many after it, are looked at: a stream that has more within the tolerance is no stream of images or poses."""

MILLISECONDS, MICROSECONDS, NANOSECONDS = 1e11, 1e14, 1e17
"""Times of the clock that are larger than these are in that unit: in seconds, the first is in the year 5138."""


def in_seconds(times: np.ndarray, per_second: float | None = None) -> np.ndarray:
    """Times [n] in seconds.

    Args:
        times: in any unit.
        per_second: how many units are a second; None if unknown: then they are of the clock, in seconds, milliseconds, microseconds or nanoseconds since 1970.
    """
    if per_second is not None:
        return times / per_second
    known = np.abs(times[np.isfinite(times)])
    largest = float(known.max()) if len(known) else 0.0
    units = ((NANOSECONDS, 1e9), (MICROSECONDS, 1e6), (MILLISECONDS, 1e3))
    return times / next((per_second for least, per_second in units if largest >= least), 1.0)


def associate(first: np.ndarray, second: np.ndarray, tolerance: float = TOLERANCE) -> dict[int, int]:
    """For entries of the first stream, the entry of the second at nearly the same time. Nearest pairs first; each entry is used once.

    Args:
        first: times [n] in any order [s].
        second: times [m] [s].
        tolerance: pairs are less than this apart [s].

    Returns:
        Positions in the second by positions in the first, in the order of the first. Entries without a partner are left out.
    """
    order = np.argsort(second, kind="stable")
    middles = np.searchsorted(second[order], first)
    begins = np.maximum(np.searchsorted(second[order], first - tolerance, side="left"), middles - NEAREST)
    ends = np.minimum(np.searchsorted(second[order], first + tolerance, side="right"), middles + NEAREST)
    pairs = sorted(
        (abs(first[i] - second[j]), i, int(j))
        for i in range(len(first))
        for j in order[begins[i] : ends[i]]
        if abs(first[i] - second[j]) < tolerance
    )
    found: dict[int, int] = {}
    used: set[int] = set()
    for _, i, j in pairs:
        if i not in found and j not in used:
            found[i] = j
            used.add(j)
    return dict(sorted(found.items()))
