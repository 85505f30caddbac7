"""Plans: what stands where in a room, whichever style drew it."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from jaxtyping import Float64

from semgs.rooms.pieces.solids import Part, Triple

WALL = 0.12
"""Thickness of walls, floor and ceiling [m]."""


@dataclass(frozen=True)
class Opening:
    """A window in a wall.

    Attributes:
        middle: where its middle is [m].
        facing: which way it faces, into the room.
        half_width: half its width along the wall [m].
        half_height: half its height [m].
        light: how bright it is, 1 on a fair day, near 0 at night or behind closed curtains.
    """

    middle: Triple
    facing: Triple
    half_width: Triple
    half_height: float
    light: float = 1.0


@dataclass(frozen=True)
class Lamp:
    """A lamp that is on: where its light is [m], and how bright, about 2 for one that lights a room."""

    place: Triple
    power: float


@dataclass(frozen=True)
class FloorPlan:
    """A furnished room, or two with an open door. The middle of its floor is the origin, z is up.

    Attributes:
        kind: what it is used for ("bedroom", "living + dining", ...).
        size: inner length (x), width (y), height (z) of all rooms together [m].
        parts: every solid, walls included.
        windows: where day comes in.
        footprints: corners of every piece of furniture on the floor, anticlockwise [m].
        pieces: first part and the one after the last of each piece that was placed: furniture, what hangs on walls, clutter.
        lamps: those that are on.
    """

    kind: str
    size: tuple[float, float, float]
    parts: tuple[Part, ...]
    windows: tuple[Opening, ...]
    footprints: tuple[Float64[np.ndarray, "4 2"], ...]
    pieces: tuple[tuple[int, int], ...] = ()
    lamps: tuple[Lamp, ...] = ()
