"""Shape of the floor: a rectangle, an L, a rectangle with a chimney breast, or two rooms joined by an opening.

With its walls, what is taken of them, and footprints on it.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field

import numpy as np
from jaxtyping import Float64

Span = tuple[float, float, float, float]
"""A part of a wall: left, right, lower and upper edge [m]."""

PARTITION = 0.12
"""Thickness of the wall between two rooms [m]."""


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


@dataclass
class Zone:
    """A room of an outline.

    Attributes:
        kind: what it is used for.
        low, high: corners of its rectangle [m].
        walls: where furniture may be placed.
        free_area: floor area [m2].
    """

    kind: str
    low: tuple[float, float]
    high: tuple[float, float]
    walls: list[Wall]
    free_area: float


@dataclass
class Outline:
    """Rooms inside one rectangle centred on the origin.

    Attributes:
        size: inner length, width, height [m].
        zones: one or two rooms.
        built: footprints of built-in blocks, solid from floor to ceiling [m].
        passage: place of the opening between two rooms, along the wall of the first room and that of the second.
    """

    size: tuple[float, float, float]
    zones: list[Zone]
    built: list[Float64[np.ndarray, "4 2"]] = field(default_factory=list)
    passage: tuple[tuple[Wall, float], tuple[Wall, float]] | None = None


def rectangular(kind: str, size: tuple[float, float, float]) -> Outline:
    """Four walls."""
    x, y, _ = size
    a, b = x / 2, y / 2
    walls = [Wall((-a, -b), 0.0, x), Wall((a, -b), np.pi / 2, y), Wall((a, b), np.pi, x), Wall((-a, b), -np.pi / 2, y)]
    return Outline(size, [Zone(kind, (-a, -b), (a, b), walls, x * y)])


def with_corner_built_in(rng: np.random.Generator, kind: str, size: tuple[float, float, float]) -> Outline:
    """An L: one corner is built in."""
    outline = rectangular(kind, size)
    (zone,) = outline.zones
    number = int(rng.integers(4))
    wall, before = zone.walls[number], zone.walls[number - 1]
    long, deep = wall.length * rng.uniform(0.25, 0.45), before.length * rng.uniform(0.25, 0.45)
    outline.built.append(rectangle(*wall.start, long, deep, wall.yaw))
    zone.walls[number] = wall.part(long, wall.length)
    zone.walls[number - 1] = before.part(0.0, before.length - deep)
    zone.walls += [
        Wall(wall.at(0.0, deep), wall.yaw, long, outer=False, built=True),
        Wall(wall.at(long, deep), wall.yaw - np.pi / 2, deep, outer=False, built=True),
    ]
    zone.free_area -= long * deep
    return outline


def with_breast(rng: np.random.Generator, kind: str, size: tuple[float, float, float]) -> Outline:
    """A chimney breast or a duct: a block that projects from a wall, with alcoves on both sides."""
    outline = rectangular(kind, size)
    (zone,) = outline.zones
    number = int(rng.integers(4))
    wall = zone.walls[number]
    long, deep = rng.uniform(0.6, 1.5), rng.uniform(0.25, 0.5)
    left = rng.uniform(0.5, wall.length - long - 0.5)
    outline.built.append(rectangle(*wall.at(left), long, deep, wall.yaw))
    zone.walls[number] = wall.part(0.0, left)
    zone.walls += [
        wall.part(left + long, wall.length),
        Wall(wall.at(left, deep), wall.yaw, long, outer=False, built=True),
        Wall(wall.at(left), wall.yaw + np.pi / 2, deep, outer=False, built=True),
        Wall(wall.at(left + long, deep), wall.yaw - np.pi / 2, deep, outer=False, built=True),
    ]
    zone.free_area -= long * deep
    return outline


def two_rooms(rng: np.random.Generator, kinds: tuple[str, str], size: tuple[float, float, float]) -> Outline:
    """Two rooms side by side along x, with an opening in the wall between them."""
    x, y, _ = size
    a, b = x / 2, y / 2
    share = x * rng.uniform(0.38, 0.62)
    split, beyond = share - a, share - a + PARTITION
    south, east, north, west = rectangular("", size).zones[0].walls
    first = Wall((split, -b), np.pi / 2, y, outer=False)
    second = Wall((beyond, b), -np.pi / 2, y, outer=False, built=True)
    zones = [
        Zone(kinds[0], (-a, -b), (split, b), [south.part(0.0, share), first, north.part(x - share, x), west], share * y),
        Zone(kinds[1], (beyond, -b), (a, b), [south.part(share + PARTITION, x), east, north.part(0.0, x - share - PARTITION), second],
             (x - share - PARTITION) * y),
    ]  # fmt: skip
    middle = y * rng.uniform(0.3, 0.7)
    return Outline(size, zones, [rectangle(split, -b, PARTITION, y, 0.0)], ((first, middle), (second, y - middle)))
