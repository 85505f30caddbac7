"""Plans: what stands where in a room, whichever style drew it."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from jaxtyping import Float64

from semgs.rooms.solids import Part

WALL = 0.12
"""Thickness of walls, floor and ceiling [m]."""


@dataclass(frozen=True)
class Opening:
    """A window in a wall: where its middle is, which way it faces, and its half extents [m]."""

    middle: tuple[float, float, float]
    facing: tuple[float, float, float]
    half_width: tuple[float, float, float]
    half_height: float


@dataclass(frozen=True)
class Plan:
    """A furnished room. The middle of its floor is the origin, z is up.

    Attributes:
        kind: "bedroom", "living", "kitchen", "bathroom", "office" or "mixed".
        size: inner length (x), width (y), height (z) [m].
        parts: every solid, walls included.
        windows: where day comes in.
        footprints: corners of every piece of furniture on the floor, anticlockwise [m].
    """

    kind: str
    size: tuple[float, float, float]
    parts: tuple[Part, ...]
    windows: tuple[Opening, ...]
    footprints: tuple[Float64[np.ndarray, "4 2"], ...]
