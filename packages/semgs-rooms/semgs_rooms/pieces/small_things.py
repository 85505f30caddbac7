"""Small things: lamps, screens, plants, books, bottles, boxes. None of them has a class.

Desks, tables and worktops look alike; what stands on them differs: `on_desk`, `on_table`, `on_worktop`.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from semgs.data.tables.classes import IGNORE
from semgs_rooms.pieces import materials as m
from semgs_rooms.pieces.materials import Material
from semgs_rooms.pieces.solids import BALL, CUSHION, CYLINDER, Piece, Solid, block, post


def television(rng: np.random.Generator, width: float) -> Piece:
    """A dark screen on a foot."""
    dark = m.plain(rng, m.colour(rng, saturation=(0, 0.2), value=(0.02, 0.1)), m.Noise(fine=0.0), gloss=0.6)
    height = width * 0.58
    screen = block(IGNORE, dark, (0, 0.08, 0.06), (width, 0.12, height + 0.06))
    foot = block(IGNORE, dark, (width * 0.3, 0.02, 0), (width * 0.7, 0.2, 0.02))
    neck = block(IGNORE, dark, (width * 0.46, 0.09, 0), (width * 0.54, 0.11, 0.1))
    return Piece("television", (width, 0.2, height + 0.06), (screen, foot, neck))


def floor_lamp(rng: np.random.Generator, lit: bool) -> Piece:
    """A foot, a pole and a shade, which shines if the lamp is on."""
    tall, reach, steel = rng.uniform(1.35, 1.7), rng.uniform(0.13, 0.2), m.metal(rng)
    shade = m.plain(rng, m.colour(rng, m.WARM_HUES, (0.0, 0.4), (0.7, 0.95)), emission=1.5 if lit else 0.0)
    foot, pole = (post(IGNORE, steel, (reach, reach), wide, 0.0, high) for wide, high in ((0.12, 0.03), (0.012, tall)))
    top = block(IGNORE, shade, (0, 0, tall - 0.28), (2 * reach, 2 * reach, tall), CYLINDER)
    return Piece("floor lamp", (2 * reach, 2 * reach, tall), (foot, pole, top))


def clutter(rng: np.random.Generator, size: float) -> Piece:
    """A random small thing of about this size [m], for a floor or a table."""
    makers = (_box, _books, _books, _pot, _plant, _plant, _bottle, _bag, _papers, _table_lamp, _ball)
    return makers[int(rng.integers(len(makers)))](rng, size)


def on_desk(rng: np.random.Generator, size: float) -> Piece:
    """A thing to work with: a laptop, a screen, a lamp, papers, books or pens."""
    makers = (_laptop, _laptop, _screen, _table_lamp, _papers, _books, _pens)
    return replace(makers[int(rng.integers(len(makers)))](rng, size), name="on a desk")


def on_table(rng: np.random.Generator, size: float) -> Piece:
    """A thing to eat from or to look at: a plate, a bowl, a glass, a bottle or flowers."""
    makers = (_plate, _plate, _bowl, _cup, _cup, _bottle, _plant)
    return replace(makers[int(rng.integers(len(makers)))](rng, size), name="on a table")


def on_worktop(rng: np.random.Generator, size: float) -> Piece:
    """A thing to cook with: a kettle, a toaster, a microwave oven, a pan, a board, bottles or jars."""
    makers = (_kettle, _toaster, _microwave, _pan, _board, _bottle, _bottle, _cup, _bowl)
    return replace(makers[int(rng.integers(len(makers)))](rng, size), name="on a worktop")


def _piece(width: float, depth: float, height: float, *parts: Solid) -> Piece:
    return Piece("clutter", (width, depth, height), parts)


def _dark(rng: np.random.Generator) -> Material:
    return m.plain(rng, m.colour(rng, saturation=(0, 0.2), value=(0.02, 0.15)), m.Noise(fine=0.0), gloss=0.6)


def _laptop(rng: np.random.Generator, size: float) -> Piece:
    """An open laptop, seen from its keyboard at +y."""
    case, dark, width, depth = m.metal(rng), _dark(rng), rng.uniform(0.3, 0.38), rng.uniform(0.21, 0.26)
    display = m.artwork(rng) if rng.random() < 0.4 else dark
    lean, tilt = 0.95 * depth, rng.uniform(0.1, 0.35)
    y, z = -lean / 2 * np.sin(tilt) + 0.005, lean / 2 * np.cos(tilt) + 0.015
    return _piece(
        width, depth, lean,
        block(IGNORE, case, (0, 0, 0), (width, depth, 0.014)),
        block(IGNORE, dark, (0.015, 0.02, 0.014), (width - 0.015, 0.55 * depth, 0.017)),
        Solid(IGNORE, case, (width / 2, float(y), float(z)), (width, 0.006, lean), tilt=float(tilt)),
        Solid(IGNORE, display, (width / 2, float(y) + 0.004, float(z)), (width - 0.02, 0.004, lean - 0.02), tilt=float(tilt)),
    )  # fmt: skip


def _screen(rng: np.random.Generator, size: float) -> Piece:
    """A monitor on a foot, with a keyboard before it."""
    dark, width, lift = _dark(rng), rng.uniform(0.45, 0.7), rng.uniform(0.06, 0.15)
    display = m.artwork(rng) if rng.random() < 0.3 else dark
    height, x = width * rng.uniform(0.55, 0.62), width / 2
    return _piece(
        width, 0.46, height + lift,
        block(IGNORE, dark, (0, 0.06, lift), (width, 0.09, lift + height)),
        block(IGNORE, display, (0.01, 0.09, lift + 0.015), (width - 0.01, 0.093, lift + height - 0.01)),
        block(IGNORE, dark, (x - 0.03, 0.04, 0), (x + 0.03, 0.06, lift + 0.1)),
        block(IGNORE, dark, (x - 0.1, 0, 0), (x + 0.1, 0.18, 0.012)),
        block(IGNORE, m.lacquer(rng), (x - 0.2, 0.32, 0), (x + 0.2, 0.45, 0.02)),
    )  # fmt: skip


def _pens(rng: np.random.Generator, size: float) -> Piece:
    """A beaker with pens."""
    parts = [post(IGNORE, m.thing(rng), (0.04, 0.04), 0.04, 0.0, 0.1)]
    for _ in range(int(rng.integers(3, 8))):
        x, y, tilt = rng.uniform(0.025, 0.055), rng.uniform(0.025, 0.055), rng.uniform(-0.2, 0.2)
        parts.append(Solid(IGNORE, m.lacquer(rng), (x, y, 0.12), (0.008, 0.008, 0.14), tilt=tilt))
    return _piece(0.08, 0.08, 0.19, *parts)


def _plate(rng: np.random.Generator, size: float) -> Piece:
    """A plate, sometimes on a mat, with a fork and a knife."""
    wide, ware, steel = rng.uniform(0.2, 0.28), m.ceramic(rng), m.metal(rng)
    low = 0.0
    parts = []
    if rng.random() < 0.4:
        low = 0.004
        parts.append(block(IGNORE, m.fabric(rng), (-0.08, -0.02, 0), (wide + 0.08, wide + 0.02, low)))
    parts += [
        block(IGNORE, ware, (0.2 * wide, 0.2 * wide, low), (0.8 * wide, 0.8 * wide, low + 0.01), CYLINDER),
        block(IGNORE, ware, (0, 0, low + 0.01), (wide, wide, low + 0.022), CYLINDER),
        *(block(IGNORE, steel, (x, 0.02, low), (x + 0.018, wide - 0.02, low + 0.004)) for x in (-0.04, wide + 0.022)),
    ]
    return _piece(wide, wide, 0.03, *parts)


def _bowl(rng: np.random.Generator, size: float) -> Piece:
    """A bowl with fruit."""
    wide, tall = rng.uniform(0.16, 0.3), rng.uniform(0.06, 0.1)
    ware = m.ceramic(rng) if rng.random() < 0.6 else m.wood(rng)
    parts = [block(IGNORE, ware, (0, 0, 0), (wide, wide, tall), CYLINDER)]
    for _ in range(int(rng.integers(0, 6))):
        x, y, half = rng.uniform(0.3 * wide, 0.7 * wide), rng.uniform(0.3 * wide, 0.7 * wide), rng.uniform(0.03, 0.042)
        fruit = m.plain(rng, m.colour(rng, (-0.03, 0.3), (0.6, 0.95), (0.4, 0.9)), gloss=0.2)
        high = tall + 2 * half - 0.03
        parts.append(block(IGNORE, fruit, (x - half, y - half, tall - 0.03), (x + half, y + half, high), BALL))
    return _piece(wide, wide, tall + 0.05, *parts)


def _cup(rng: np.random.Generator, size: float) -> Piece:
    """A cup, a mug or a glass."""
    wide, tall, ware = rng.uniform(0.06, 0.09), rng.uniform(0.07, 0.15), m.ceramic(rng)
    cup = ware if rng.random() < 0.6 else m.thing(rng)
    return _piece(wide, wide, tall, block(IGNORE, cup, (0, 0, 0), (wide, wide, tall), CYLINDER))


def _kettle(rng: np.random.Generator, size: float) -> Piece:
    """A kettle or a coffee pot with a handle."""
    wide, tall = rng.uniform(0.13, 0.18), rng.uniform(0.18, 0.26)
    skin, grip = m.metal(rng) if rng.random() < 0.6 else m.lacquer(rng), _dark(rng)
    pot = block(IGNORE, skin, (0, 0, 0), (wide, wide, 0.85 * tall), CYLINDER)
    lid = block(IGNORE, grip, (0.2 * wide, 0.2 * wide, 0.85 * tall), (0.8 * wide, 0.8 * wide, 0.92 * tall), CYLINDER)
    handle = block(IGNORE, grip, (0.45 * wide, wide, 0.2 * tall), (0.6 * wide, wide + 0.05, 0.9 * tall))
    return _piece(wide, wide, tall, pot, lid, handle)


def _toaster(rng: np.random.Generator, size: float) -> Piece:
    """A toaster with two slots."""
    width, depth, tall, dark = rng.uniform(0.26, 0.32), rng.uniform(0.16, 0.2), rng.uniform(0.17, 0.21), _dark(rng)
    skin = m.metal(rng) if rng.random() < 0.6 else m.lacquer(rng)
    parts = [block(IGNORE, skin, (0, 0, 0), (width, depth, tall))]
    for y in (0.32 * depth, 0.68 * depth):
        parts.append(block(IGNORE, dark, (0.05, y - 0.012, tall), (width - 0.05, y + 0.012, tall + 0.002)))
    return _piece(width, depth, tall, *parts)


def _microwave(rng: np.random.Generator, size: float) -> Piece:
    """A microwave oven with its window and buttons towards +y."""
    width, depth, tall = rng.uniform(0.44, 0.52), rng.uniform(0.32, 0.38), rng.uniform(0.25, 0.3)
    dark, skin = _dark(rng), m.lacquer(rng) if rng.random() < 0.5 else m.metal(rng)
    body = block(IGNORE, skin, (0, 0, 0.01), (width, depth, tall))
    window = block(IGNORE, dark, (0.03, depth, 0.05), (0.7 * width, depth + 0.004, tall - 0.04))
    buttons = block(IGNORE, dark, (0.76 * width, depth, 0.03), (0.96 * width, depth + 0.003, tall - 0.02))
    return _piece(width, depth, tall, body, window, buttons)


def _pan(rng: np.random.Generator, size: float) -> Piece:
    """A pot or a pan with a handle."""
    wide, tall, steel = rng.uniform(0.18, 0.28), rng.uniform(0.05, 0.16), m.metal(rng)
    grip, end = _dark(rng), wide + rng.uniform(0.05, 0.18)
    handle = block(IGNORE, grip, (wide, 0.45 * wide, 0.7 * tall), (end, 0.55 * wide, 0.7 * tall + 0.015))
    return _piece(wide, wide, tall, block(IGNORE, steel, (0, 0, 0), (wide, wide, tall), CYLINDER), handle)


def _board(rng: np.random.Generator, size: float) -> Piece:
    """A cutting board, sometimes with something on it."""
    width, depth = rng.uniform(0.26, 0.42), rng.uniform(0.18, 0.28)
    parts = [block(IGNORE, m.wood(rng), (0, 0, 0), (width, depth, 0.018))]
    if rng.random() < 0.6:
        x, loaf = rng.uniform(0.06, width - 0.2), m.colour(rng, (0.0, 0.3), (0.4, 0.9), (0.3, 0.85))
        parts.append(block(IGNORE, m.plain(rng, loaf), (x, 0.05, 0.018), (x + 0.14, depth - 0.05, 0.1), CUSHION))
    return _piece(width, depth, 0.1, *parts)


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
        parts.append(Solid(IGNORE, green, centre, (wide, 0.006, long), CUSHION, yaw=yaw, tilt=lean))
    return _piece(pot, pot, tall, *parts)


def _bottle(rng: np.random.Generator, size: float) -> Piece:
    width, height = min(size * 0.35, 0.1), min(size * rng.uniform(0.8, 1.4), 0.38)
    look, x = m.thing(rng), min(size * 0.35, 0.1) / 2
    body = block(IGNORE, look, (0, 0, 0), (width, width, 0.65 * height), CYLINDER)
    neck = block(IGNORE, look, (x * 0.6, x * 0.6, 0.6 * height), (x * 1.4, x * 1.4, height), CYLINDER)
    return _piece(width, width, height, body, neck)


def _bag(rng: np.random.Generator, size: float) -> Piece:
    """A bag, a cushion or a heap of cloth."""
    width, depth, height, cloth = size, size * rng.uniform(0.4, 0.7), size * rng.uniform(0.3, 0.9), m.fabric(rng)
    heap = block(IGNORE, cloth, (0, 0, 0), (width, depth, height), CUSHION, tilt=rng.uniform(-0.1, 0.1))
    return _piece(width, depth, height, heap)


def _papers(rng: np.random.Generator, size: float) -> Piece:
    """One to three sheets on top of each other."""
    white = m.plain(rng, m.colour(rng, saturation=(0, 0.1), value=(0.8, 0.97)), m.Noise(fine=0.05))
    width, depth = 0.21, 0.297
    parts = []
    for i in range(int(rng.integers(1, 4))):
        sheet, yaw = white if rng.random() < 0.7 else m.artwork(rng), rng.uniform(-0.5, 0.5)
        parts.append(block(IGNORE, sheet, (0, 0, 0.002 * i), (width, depth, 0.002 * (i + 1)), yaw=yaw))
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
