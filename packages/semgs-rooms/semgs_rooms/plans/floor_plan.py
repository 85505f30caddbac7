"""Floor plan of a room, the same for every style."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from jaxtyping import Float64

from semgs_rooms.pieces.solids import Solid, Triple

WALL = 0.12
"""Thickness of walls, floor and ceiling [m]."""


@dataclass(frozen=True)
class Opening:
    """A window in a wall.

    Attributes:
        middle: its centre [m].
        facing: unit vector into the room.
        half_width: half its width, as a vector along the wall [m].
        half_height: half its height [m].
        light: brightness: 1 on a fair day, near 0 at night or behind closed curtains.
    """

    middle: Triple
    facing: Triple
    half_width: Triple
    half_height: float
    light: float = 1.0


@dataclass(frozen=True)
class Lamp:
    """A lamp that is on: its position [m] and brightness, about 2 for one that lights a room."""

    place: Triple
    power: float


@dataclass(frozen=True)
class FloorPlan:
    """A furnished room, or two joined by an opening. The origin is the middle of the floor, z is up.

    Attributes:
        kind: what it is used for ("bedroom", "living + dining", ...).
        size: inner length (x), width (y) and height (z) of all rooms together [m].
        parts: every solid, including walls.
        windows: where daylight comes in.
        footprints: corners of each piece of furniture on the floor, anticlockwise [m].
        pieces: range of parts (first, end) of each furniture piece, wall decoration and clutter.
        lamps: those that are on.
        instances: range of parts of each thing that has a number in maps of instances; None for those of `pieces`, which cameras choose from.
    """

    kind: str
    size: tuple[float, float, float]
    parts: tuple[Solid, ...]
    windows: tuple[Opening, ...]
    footprints: tuple[Float64[np.ndarray, "4 2"], ...]
    pieces: tuple[tuple[int, int], ...] = ()
    lamps: tuple[Lamp, ...] = ()
    instances: tuple[tuple[int, int], ...] | None = None
