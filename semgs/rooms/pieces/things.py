"""Small things: lamps, screens, plants, books, bottles, boxes. None of them has a class."""

from __future__ import annotations

import numpy as np

from semgs.data.classes import IGNORE
from semgs.rooms.pieces import materials as m
from semgs.rooms.pieces.solids import BALL, CUSHION, CYLINDER, Part, Piece, block, post


def television(rng: np.random.Generator, width: float) -> Piece:
    """A dark screen on a foot."""
    dark = m.plain(rng, m.colour(rng, saturation=(0, 0.2), value=(0.02, 0.1)), m.Noise(fine=0.0), gloss=0.6)
    height = width * 0.58
    parts = [
        block(IGNORE, dark, (0, 0.08, 0.06), (width, 0.12, height + 0.06)),
        block(IGNORE, dark, (width * 0.3, 0.02, 0), (width * 0.7, 0.2, 0.02)),
        block(IGNORE, dark, (width * 0.46, 0.09, 0), (width * 0.54, 0.11, 0.1)),
    ]
    return Piece("television", (width, 0.2, height + 0.06), tuple(parts))


def floor_lamp(rng: np.random.Generator, lit: bool) -> Piece:
    """A foot, a pole and a shade, which shines if the lamp is on."""
    tall, reach, steel = rng.uniform(1.35, 1.7), rng.uniform(0.13, 0.2), m.metal(rng)
    shade = m.plain(rng, m.colour(rng, m.WARM_HUES, (0.0, 0.4), (0.7, 0.95)), emission=1.5 if lit else 0.0)
    parts = [
        post(IGNORE, steel, (reach, reach), 0.12, 0.0, 0.03),
        post(IGNORE, steel, (reach, reach), 0.012, 0.0, tall),
        block(IGNORE, shade, (0, 0, tall - 0.28), (2 * reach, 2 * reach, tall), CYLINDER),
    ]
    return Piece("floor lamp", (2 * reach, 2 * reach, tall), tuple(parts))


def clutter(rng: np.random.Generator, size: float) -> Piece:
    """A random small thing of about this size [m], for a floor or a table."""
    makers = (_box, _books, _books, _pot, _plant, _plant, _bottle, _bag, _papers, _table_lamp, _ball)
    return makers[int(rng.integers(len(makers)))](rng, size)


def _piece(width: float, depth: float, height: float, *parts: Part) -> Piece:
    return Piece("clutter", (width, depth, height), parts)


def _box(rng: np.random.Generator, size: float) -> Piece:
    width, depth, height = (size * rng.uniform(0.5, 1.0) for _ in range(3))
    return _piece(width, depth, height, block(IGNORE, m.thing(rng), (0, 0, 0), (width, depth, height)))


def _books(rng: np.random.Generator, size: float) -> Piece:
    """A pile of one to five, each slightly turned."""
    width, depth, height = min(size, 0.3) * rng.uniform(0.6, 1.0), min(size, 0.3) * rng.uniform(0.5, 0.8), 0.0
    parts = []
    for _ in range(int(rng.integers(1, 6))):
        thick = rng.uniform(0.012, 0.045)
        book = m.thing(rng)
        parts.append(block(IGNORE, book, (0, 0, height), (width, depth, height + thick), yaw=rng.uniform(-0.3, 0.3)))
        height += thick
    return _piece(width, depth, height, *parts)


def _pot(rng: np.random.Generator, size: float) -> Piece:
    """A cup, a vase or a bin."""
    width, height = size * rng.uniform(0.35, 0.8), size * rng.uniform(0.5, 1.0)
    return _piece(width, width, height, block(IGNORE, m.thing(rng), (0, 0, 0), (width, width, height), CYLINDER))


def _plant(rng: np.random.Generator, size: float) -> Piece:
    """Blades that rise out of a pot and lean outwards."""
    pot, high, tall = size * rng.uniform(0.3, 0.5), size * rng.uniform(0.25, 0.5), size * rng.uniform(0.9, 2.0)
    leaf = m.colour(rng, m.GREEN_HUES, (0.3, 0.8), (0.12, 0.55))
    green = m.plain(rng, leaf, m.Noise(0.3, size * 0.05, 0.4, size * 0.15))
    parts = [post(IGNORE, m.ceramic(rng) if rng.random() < 0.6 else m.thing(rng), (0.0, 0.0), pot / 2, 0.0, high)]
    for _ in range(int(rng.integers(10, 22))):
        yaw, lean = rng.uniform(-np.pi, np.pi), rng.uniform(0.1, 1.0)
        long, wide = tall * rng.uniform(0.4, 0.8), size * rng.uniform(0.04, 0.12)
        # The blade starts in the pot, so its middle is half its length away in the direction it leans.
        out, up = long / 2 * np.sin(lean), long / 2 * np.cos(lean)
        centre = (float(np.sin(yaw) * out), float(-np.cos(yaw) * out), float(0.9 * high + up))
        parts.append(Part(IGNORE, green, centre, (wide, 0.006, long), CUSHION, yaw=yaw, tilt=lean))
    return _piece(pot, pot, tall, *parts)


def _bottle(rng: np.random.Generator, size: float) -> Piece:
    width, height = min(size * 0.35, 0.1), min(size * rng.uniform(0.8, 1.4), 0.38)
    look, x = m.thing(rng), min(size * 0.35, 0.1) / 2
    return _piece(
        width, width, height,
        block(IGNORE, look, (0, 0, 0), (width, width, 0.65 * height), CYLINDER),
        block(IGNORE, look, (x * 0.6, x * 0.6, 0.6 * height), (x * 1.4, x * 1.4, height), CYLINDER),
    )  # fmt: skip


def _bag(rng: np.random.Generator, size: float) -> Piece:
    """A bag, a cushion or a heap of cloth."""
    width, depth, height, cloth = size, size * rng.uniform(0.4, 0.7), size * rng.uniform(0.3, 0.9), m.fabric(rng)
    heap = block(IGNORE, cloth, (0, 0, 0), (width, depth, height), CUSHION, tilt=rng.uniform(-0.1, 0.1))
    return _piece(width, depth, height, heap)


def _papers(rng: np.random.Generator, size: float) -> Piece:
    """One to three sheets on top of each other."""
    white = m.plain(rng, m.colour(rng, saturation=(0, 0.1), value=(0.8, 0.97)), m.Noise(fine=0.05))
    width, depth = 0.21, 0.297
    parts = [
        block(IGNORE, white if rng.random() < 0.7 else m.artwork(rng), (0, 0, 0.002 * i), (width, depth, 0.002 * (i + 1)), yaw=rng.uniform(-0.5, 0.5))
        for i in range(int(rng.integers(1, 4)))
    ]  # fmt: skip
    return _piece(width, depth, 0.006, *parts)


def _table_lamp(rng: np.random.Generator, size: float) -> Piece:
    width, height, middle = size * 0.7, size * 1.3, size * 0.35
    shade = m.plain(rng, m.colour(rng, m.WARM_HUES, (0.0, 0.4), (0.7, 0.95)), emission=rng.choice([0.0, 1.2]))
    return _piece(
        width, width, height,
        block(IGNORE, m.thing(rng), (middle * 0.6, middle * 0.6, 0), (middle * 1.4, middle * 1.4, height * 0.12), CYLINDER),
        block(IGNORE, m.metal(rng), (middle * 0.9, middle * 0.9, 0), (middle * 1.1, middle * 1.1, height * 0.6), CYLINDER),
        block(IGNORE, shade, (0, 0, height * 0.6), (width, width, height), CYLINDER),
    )  # fmt: skip


def _ball(rng: np.random.Generator, size: float) -> Piece:
    width = min(size * 0.6, 0.24)
    return _piece(width, width, width, block(IGNORE, m.thing(rng), (0, 0, 0), (width, width, width), BALL))
