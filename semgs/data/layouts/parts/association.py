"""Association by time: which of two streams' entries belong together, as TUM RGB-D's own tool has it."""

from __future__ import annotations

import numpy as np

TOLERANCE = 0.02
"""Entries further apart than this do not belong together [s]: TUM RGB-D's default."""


def associated(first: np.ndarray, second: np.ndarray, tolerance: float = TOLERANCE) -> dict[int, int]:
    """For entries of the first stream the entry of the second at nearly the same time, each used once, nearest pairs first.

    Args:
        first: times [n] in any order [s].
        second: times [m] [s].
        tolerance: pairs are less than this apart [s].

    Returns:
        Positions in the second by positions in the first, in the order of the first; what has no partner is left out.
    """
    order = np.argsort(second, kind="stable")
    begins = np.searchsorted(second[order], first - tolerance, side="left")
    ends = np.searchsorted(second[order], first + tolerance, side="right")
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
