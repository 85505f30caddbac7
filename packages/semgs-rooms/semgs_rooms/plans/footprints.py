"""Footprints on the floor and occupied parts of walls."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field

import numpy as np
from jaxtyping import Float64

Span = tuple[float, float, float, float]
"""A part of a wall: left, right, lower and upper edge [m]."""


def floor_point(origin: tuple[float, float], yaw: float, along: float, off: float) -> tuple[float, float]:
    """A point on the floor, given in a frame with this origin and yaw."""
    cosine, sine = np.cos(yaw), np.sin(yaw)
    return float(origin[0] + along * cosine - off * sine), float(origin[1] + along * sine + off * cosine)


def rectangle(x: float, y: float, width: float, depth: float, yaw: float) -> Float64[np.ndarray, "4 2"]:
    """Corners of a footprint with its origin at (x, y), anticlockwise."""
    cosine, sine = np.cos(yaw), np.sin(yaw)
    own = np.array([[0, 0], [width, 0], [width, depth], [0, depth]], dtype=np.float64)
    return own @ np.array([[cosine, sine], [-sine, cosine]]) + (x, y)


def overlap(a: Float64[np.ndarray, "4 2"], b: Float64[np.ndarray, "4 2"]) -> bool:
    """Whether two rectangles overlap: no side of either separates them (separating axis theorem)."""
    for one, other in ((a, b), (b, a)):
        for start, end in ((one[0], one[1]), (one[1], one[2])):
            axis = end - start
            mine, theirs = one @ axis, other @ axis
            if mine.max() <= theirs.min() or theirs.max() <= mine.min():
                return False
    return True


def around(length: float, low: float, high: float, holes: Sequence[Span]) -> list[Span]:
    """Rectangles that cover a strip of a wall from `low` to `high` except its holes. No hole may be above another."""
    result: list[Span] = []
    start = 0.0
    for left, right, bottom, top in sorted(holes):
        result += [(start, left, low, high), (left, right, low, min(bottom, high)), (left, right, max(top, low), high)]
        start = right
    result.append((start, length, low, high))
    return [(left, right, bottom, top) for left, right, bottom, top in result if right > left and top > bottom]


@dataclass
class Wall:
    """A wall with its own frame: x along the wall, y = 0 on its face, y into the room.

    Attributes:
        start: origin of that frame, the wall's left end seen from the room [m].
        yaw: of its x axis [rad].
        length: [m].
        outer: whether it may have windows and outer doors.
        built: whether another solid is already behind it, as for the sides of a projecting block.
        taken: parts covered by what hangs on it or stands in front.
        holes: windows and doors.
    """

    start: tuple[float, float]
    yaw: float
    length: float
    outer: bool = True
    built: bool = False
    taken: list[Span] = field(default_factory=list)
    holes: list[Span] = field(default_factory=list)

    def at(self, along: float, off: float = 0.0) -> tuple[float, float]:
        """The point on the floor at a distance along the wall and a distance away from it [m]."""
        return floor_point(self.start, self.yaw, along, off)

    def free(self, left: float, right: float, low: float, high: float) -> bool:
        """Whether that part of the wall is free."""
        return all(right <= a or left >= b or high <= c or low >= d for a, b, c, d in self.taken)

    def part(self, left: float, right: float) -> Wall:
        """The stretch of the wall between two places along it, with nothing on it."""
        return Wall(self.at(left), self.yaw, right - left, self.outer, self.built)
