"""The style `plain`: boxes with noise textures, thirteen classes. It is kept as the baseline that richer worlds are measured against."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from jaxtyping import Float64

from semgs.data.classes import IGNORE
from semgs.rooms import materials as m
from semgs.rooms.footprints import overlap, rectangle
from semgs.rooms.furniture import LABEL
from semgs.rooms.plans import WALL, Opening, Plan
from semgs.rooms.solids import Part, Triple, block, moved

Boxes = tuple[tuple[Triple, Triple], ...]
"""Opposite corners of boxes in shares of a piece's size."""

SEAT: Boxes = (((0, 0, 0.35), (1, 1, 0.5)), ((0, 0, 0.5), (1, 0.15, 1)), ((0.1, 0.1, 0), (0.9, 0.9, 0.35)))
TOP: Boxes = (((0, 0, 0.9), (1, 1, 1)), ((0.05, 0.1, 0), (0.12, 0.9, 0.9)), ((0.88, 0.1, 0), (0.95, 0.9, 0.9)))
WHOLE: Boxes = (((0, 0, 0), (1, 1, 1)),)
BED: Boxes = (((0, 0, 0), (1, 1, 0.6)), ((0, 0, 0.6), (1, 0.05, 1)), ((0.1, 0.06, 0.6), (0.9, 0.25, 0.75)))
SHELF: Boxes = (
    ((0, 0, 0), (1, 0.2, 1)), ((0, 0.2, 0), (0.04, 1, 1)), ((0.96, 0.2, 0), (1, 1, 1)),
    *(((0.04, 0.2, z), (0.96, 1, z + 0.03)) for z in (0, 0.32, 0.65, 0.97)),
)  # fmt: skip

STANDING: dict[str, tuple[Boxes, Triple, Triple]] = {
    "cabinet": (WHOLE, (0.5, 0.4, 0.6), (1.6, 0.6, 2.0)),
    "bed": (BED, (0.9, 1.9, 0.7), (1.8, 2.2, 1.1)),
    "chair": (SEAT, (0.4, 0.4, 0.8), (0.55, 0.55, 1.0)),
    "sofa": (SEAT, (1.4, 0.8, 0.7), (2.3, 1.0, 0.95)),
    "table": (TOP, (0.8, 0.6, 0.4), (1.8, 1.0, 0.78)),
    "bookshelf": (SHELF, (0.6, 0.25, 1.0), (1.4, 0.4, 2.1)),
    "counter": (WHOLE, (1.0, 0.5, 0.85), (2.4, 0.7, 1.0)),
    "desk": (TOP, (1.0, 0.55, 0.7), (1.7, 0.8, 0.78)),
}
"""The boxes of each kind of furniture, and its smallest and largest size [m]."""

HANGING: dict[str, tuple[Triple, Triple, float, float]] = {
    "door": ((0.75, 0.04, 1.95), (1.0, 0.04, 2.1), 0.0, 0.0),
    "window": ((0.7, 0.03, 0.7), (1.8, 0.03, 1.3), 0.7, 1.0),
    "picture": ((0.3, 0.03, 0.3), (1.0, 0.03, 0.8), 1.2, 1.5),
}
"""Smallest and largest size, lowest and highest lower edge of what hangs on walls [m]."""


def draw_plain(rng: np.random.Generator) -> Plan:
    """A random rectangular room with six to ten pieces at its walls or in the open."""
    size = (rng.uniform(3.0, 6.5), rng.uniform(2.8, 5.0), rng.uniform(2.3, 2.9))
    x, y, z = size
    a, b = x / 2 + WALL, y / 2 + WALL
    walls = (((-x / 2, -y / 2), 0.0, x), ((x / 2, -y / 2), np.pi / 2, y), ((x / 2, y / 2), np.pi, x), ((-x / 2, y / 2), -np.pi / 2, y))  # fmt: skip
    parts = [
        block(LABEL["floor"], _noise(rng), (-a, -b, -WALL), (a, b, 0)),
        block(IGNORE, _noise(rng), (-a, -b, z), (a, b, z + WALL)),
    ]
    for start, yaw, length in walls:
        parts += moved(
            [block(LABEL["wall"], _noise(rng), (-WALL, -WALL, 0), (length + WALL, 0, z))], (*start, 0.0), yaw
        )
    hung: list[tuple[int, float, float]] = []
    windows: list[Opening] = []
    for name in ("door", "window", "window", "picture", "picture", "picture"):
        smallest, largest, lowest, highest = HANGING[name]
        width, thick, tall = _between(rng, smallest, largest)
        low = rng.uniform(lowest, highest)
        number = int(rng.integers(4))
        start, yaw, length = walls[number]
        left = rng.uniform(0.1, length - width - 0.1)
        if low + tall > z - 0.05 or any(w == number and left < d and left + width > c for w, c, d in hung):
            continue
        hung.append((number, left, left + width))
        turn = np.array([np.cos(yaw), np.sin(yaw)])
        corner = np.array(start) + left * turn
        glow = rng.uniform(0.4, 1.4) if name == "window" else 0.0
        piece = block(LABEL[name], _noise(rng, glow), (0, 0, low), (width, thick, low + tall))
        parts += moved([piece], (float(corner[0]), float(corner[1]), 0.0), yaw)
        if name == "window":
            middle, half = corner + turn * width / 2, turn * width / 2
            windows.append(Opening((float(middle[0]), float(middle[1]), low + tall / 2), (-float(turn[1]), float(turn[0]), 0.0),
                                   (float(half[0]), float(half[1]), 0.0), tall / 2))  # fmt: skip
    footprints: list[Float64[np.ndarray, "4 2"]] = []
    for name in rng.choice(list(STANDING), int(rng.integers(6, 11))):
        _stand(rng, str(name), size, walls, footprints, parts)
    return Plan("plain", size, tuple(parts), tuple(windows), tuple(footprints))


def _stand(
    rng: np.random.Generator,
    name: str,
    room: tuple[float, float, float],
    walls: Sequence[tuple[tuple[float, float], float, float]],
    footprints: list[Float64[np.ndarray, "4 2"]],
    parts: list[Part],
) -> None:
    """Add a piece where it finds room, with its back to a wall in two of three cases; leave it out where it finds none."""
    shape, smallest, largest = STANDING[name]
    width, depth, height = _between(rng, smallest, largest)
    for _ in range(12):
        start, yaw, length = walls[int(rng.integers(4))]
        if rng.random() < 0.65:
            along, off = rng.uniform(0.03, max(0.04, length - width - 0.03)), 0.05
            x = start[0] + along * np.cos(yaw) - off * np.sin(yaw)
            y = start[1] + along * np.sin(yaw) + off * np.cos(yaw)
        else:
            x, y = (rng.uniform(-0.4, 0.4) * side for side in room[:2])
        footprint = rectangle(x, y, width, depth, yaw)
        if (np.abs(footprint) > (room[0] / 2 - 0.01, room[1] / 2 - 0.01)).any():
            continue
        if any(overlap(rectangle(x, y, width, depth, yaw), other) for other in footprints):
            continue
        footprints.append(footprint)
        scale = np.array([width, depth, height])
        cover, body = _noise(rng), _noise(rng)
        blocks = [
            block(LABEL[name], body if i else cover, _triple(np.array(low) * scale), _triple(np.array(high) * scale))
            for i, (low, high) in enumerate(shape)
        ]
        parts += moved(blocks, (float(x), float(y), 0.0), yaw)
        return


def _noise(rng: np.random.Generator, emission: float = 0.0) -> m.Row:
    """Any colour with grain and blotches."""
    return m.row(rng, a=m.colour(rng), fine=rng.uniform(0.05, 0.35), fine_scale=rng.uniform(0.01, 0.06),
                 blotch=rng.uniform(0.1, 0.4), blotch_scale=rng.uniform(0.1, 0.6), emission=emission)  # fmt: skip


def _between(rng: np.random.Generator, smallest: Triple, largest: Triple) -> Triple:
    """A size between two sizes."""
    return _triple(rng.uniform(smallest, largest))


def _triple(values: Float64[np.ndarray, " 3"]) -> Triple:
    x, y, z = (float(value) for value in values)
    return x, y, z
