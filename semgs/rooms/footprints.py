"""Footprints: what covers which part of a floor or of a wall."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np
from jaxtyping import Float64


def rectangle(x: float, y: float, width: float, depth: float, yaw: float) -> Float64[np.ndarray, "4 2"]:
    """Corners of a footprint whose own (0, 0) is at (x, y), anticlockwise."""
    cosine, sine = np.cos(yaw), np.sin(yaw)
    own = np.array([[0, 0], [width, 0], [width, depth], [0, depth]], dtype=np.float64)
    return own @ np.array([[cosine, sine], [-sine, cosine]]) + (x, y)


def overlap(a: Float64[np.ndarray, "4 2"], b: Float64[np.ndarray, "4 2"]) -> bool:
    """Whether two rectangles share area: no side of either has all of the other beyond it (separating axes)."""
    for one, other in ((a, b), (b, a)):
        for start, end in ((one[0], one[1]), (one[1], one[2])):
            axis = end - start
            mine, theirs = one @ axis, other @ axis
            if mine.max() <= theirs.min() or theirs.max() <= mine.min():
                return False
    return True


@dataclass
class Wall:
    """A wall: where its own x axis starts when seen from the room, the yaw of that axis, its length, and what hangs on it.

    A piece set against it keeps its frame: y = 0 on the wall, y into the room.
    """

    start: tuple[float, float]
    yaw: float
    length: float
    taken: list[tuple[float, float, float, float]] = field(default_factory=list)

    def at(self, along: float, off: float = 0.0) -> tuple[float, float]:
        """The floor's point at a place along the wall and a distance off it."""
        cosine, sine = float(np.cos(self.yaw)), float(np.sin(self.yaw))
        return self.start[0] + along * cosine - off * sine, self.start[1] + along * sine + off * cosine

    def free(self, left: float, right: float, low: float, high: float) -> bool:
        """Whether nothing is on that part of the wall."""
        return all(right <= a or left >= b or high <= c or low >= d for a, b, c, d in self.taken)
