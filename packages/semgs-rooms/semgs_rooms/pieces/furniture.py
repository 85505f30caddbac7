"""Beds, seats, tables and desks with random proportions and materials."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from semgs.data.tables.classes import IGNORE, SCANNET20
from semgs_rooms.pieces import materials as m
from semgs_rooms.pieces.materials import Material, Range
from semgs_rooms.pieces.solids import BOX, CUSHION, CYLINDER, Piece, Solid, block, post

Maker = Callable[[np.random.Generator], Piece]
"""A function that makes a piece from a random generator."""

LABEL = {name: SCANNET20.index(name) for name in SCANNET20.names}


def legs(
    label: int, material: Material, width: float, depth: float, height: float, thickness: float, inset: float = 0.0
) -> list[Solid]:
    """Four legs under a rectangle."""
    upright = m.along(material, 2)
    near, far = inset, thickness + inset
    return [
        block(label, upright, (x, y, 0), (x + thickness, y + thickness, height))
        for x in (near, width - far)
        for y in (near, depth - far)
    ]


def bed(rng: np.random.Generator) -> Piece:
    """Frame, mattress, cover, pillows, and usually a headboard."""
    label = LABEL["bed"]
    width, depth = float(rng.choice([0.9, 1.2, 1.4, 1.6, 1.8])) + rng.uniform(-0.05, 0.1), rng.uniform(1.95, 2.2)
    frame = m.carpentry(rng) if rng.random() < 0.7 else m.fabric(rng)
    low, thick = rng.uniform(0.15, 0.35), rng.uniform(0.15, 0.28)
    top = low + thick
    parts = [block(label, frame, (0, 0, rng.choice([0.0, 0.1])), (width, depth, low))]
    if parts[0].centre[2] > low / 2:
        parts += legs(label, frame, width, depth, 0.1, 0.07)
    parts.append(block(label, m.bedding(rng), (0.02, 0.03, low), (width - 0.02, depth - 0.03, top)))
    height = top
    if rng.random() < 0.8:
        board = rng.uniform(0.75, 1.3)
        parts.append(block(label, frame, (-0.02, -0.06, 0), (width + 0.02, 0.02, board)))
        height = board
    cover, drop = m.bedding(rng), rng.uniform(0.05, 0.3)
    start = rng.uniform(0.35, 0.9)
    under, over = top - drop, top + rng.uniform(0.025, 0.07)
    parts.append(block(label, cover, (-0.025, start, under), (width + 0.025, depth + 0.02, over)))
    if rng.random() < 0.4:
        fold = depth - rng.uniform(0.3, 0.7)
        parts.append(block(label, m.fabric(rng), (-0.04, fold, under), (width + 0.04, depth + 0.03, top + 0.085)))
    pillow, count = m.bedding(rng), 1 if width < 1.3 else 2
    span = width / count
    for layer in range(int(rng.integers(1, 3))):
        for i in range(count):
            half = span * rng.uniform(0.38, 0.46)
            middle, back = (i + 0.5) * span, 0.04 + 0.14 * layer
            lift = top - 0.03 + 0.05 * layer
            parts.append(block(label, pillow, (middle - half, back, lift), (middle + half, back + 0.4, lift + 0.17), CUSHION,
                               yaw=rng.uniform(-0.12, 0.12), tilt=rng.uniform(-0.15, 0.0)))  # fmt: skip
        pillow = m.fabric(rng)
    return Piece("bed", (width, depth, height), tuple(parts))


def sofa(rng: np.random.Generator, seats: int | None = None, label: int = LABEL["sofa"]) -> Piece:
    """Base, seat and back cushions, arms, scatter cushions."""
    seats = int(rng.integers(2, 4)) if seats is None else seats
    arm, seat = rng.uniform(0.1, 0.26), rng.uniform(0.55, 0.75)
    width, depth = 2 * arm + seats * seat, rng.uniform(0.78, 1.0)
    cloth = m.fabric(rng)
    base, height, rest = rng.uniform(0.24, 0.32), rng.uniform(0.7, 0.95), rng.uniform(0.5, 0.66)
    feet = rng.choice([0.0, 0.08, 0.13])
    back, thick = rng.uniform(0.14, 0.24), rng.uniform(0.12, 0.2)
    parts = [block(label, cloth, (0, 0, feet), (width, depth - 0.02, base))]
    parts.append(block(label, cloth, (0, 0, base), (width, back, height)))
    parts += [block(label, cloth, (x, 0, base), (end, depth, rest)) for x, end in ((0, arm), (width - arm, width))]
    if feet:
        parts += legs(label, m.wood(rng, 2), width, depth - 0.05, feet, 0.05, 0.03)
    shape, top = CUSHION if rng.random() < 0.6 else BOX, base + thick
    for i in range(seats):
        across = (arm + i * seat, arm + i * seat + seat)
        parts += seat_cushions(label, cloth, shape, across, (back, depth), (base - 0.03, top, height + 0.04))
    parts += scatter_cushions(rng, label, int(rng.integers(0, 3)), (arm + 0.25, width - arm - 0.25), back, top)
    return Piece("sofa", (width, depth + 0.01, height + 0.04), tuple(parts))


def seat_cushions(
    label: int, cloth: Material, shape: int, across: Range, deep: Range, upwards: tuple[float, float, float]
) -> list[Solid]:
    """The cushion of a seat, from its back to its front edge (`deep`), and the one behind it; `upwards`: underside and top of the first,
    top of the second."""
    (left, right), (back, front), (low, seat, high) = across, deep, upwards
    left, right = left + 0.006, right - 0.006
    return [
        block(label, cloth, (left, back, low), (right, front + 0.01, seat), shape),
        block(label, cloth, (left, back - 0.03, seat - 0.03), (right, back + 0.17, high), shape, tilt=0.12),
    ]


def scatter_cushions(
    rng: np.random.Generator, label: int, count: int, across: Range, back: float, seat: float
) -> list[Solid]:
    """Cushions that lean against the back of a sofa, on its seat, with their middles in a range [m]."""
    parts = []
    for _ in range(count):
        x, half = rng.uniform(*across), rng.uniform(0.18, 0.25)
        cloth, yaw = m.fabric(rng), rng.uniform(-0.25, 0.25)
        low, high = (x - half, back + 0.17, seat - 0.02), (x + half, back + 0.31, seat + 2 * half - 0.03)
        parts.append(block(label, cloth, low, high, CUSHION, yaw=yaw, tilt=0.3))
    return parts


def armchair(rng: np.random.Generator) -> Piece:
    """A sofa with one seat, labelled as a chair."""
    piece = sofa(rng, seats=1, label=LABEL["chair"])
    return Piece("armchair", piece.size, piece.parts)


def chair(rng: np.random.Generator) -> Piece:
    """A dining chair with a slatted, solid or padded back, an office chair, or a stool."""
    label, look = LABEL["chair"], rng.random()
    width, depth, seat = rng.uniform(0.4, 0.52), rng.uniform(0.42, 0.52), rng.uniform(0.42, 0.5)
    top = seat + rng.uniform(0.35, 0.55)
    if look < 0.3:
        cloth, frame = m.fabric(rng), m.metal(rng)
        x, y = width / 2, depth / 2
        parts = [
            post(label, frame, (x, y), 0.03, 0.06, seat),
            block(label, cloth, (0, 0, seat - 0.03), (width, depth, seat + 0.06), CUSHION),
            block(label, cloth, (0.02, -0.03, seat + 0.12), (width - 0.02, 0.06, top + 0.1), CUSHION, tilt=0.1),
            block(label, frame, (x - 0.025, -0.02, seat), (x + 0.025, 0.0, seat + 0.3)),
        ]
        low, high = (x - 0.28, y - 0.025, 0.03), (x + 0.28, y + 0.025, 0.075)
        parts += [block(label, frame, low, high, yaw=k * np.pi / 3) for k in range(3)]
        if rng.random() < 0.5:
            for side in (-0.03, width - 0.02):
                parts.append(block(label, frame, (side, 0.08, seat + 0.17), (side + 0.05, depth - 0.1, seat + 0.2)))
                parts.append(block(label, frame, (side, 0.18, seat), (side + 0.04, 0.22, seat + 0.17)))
        return Piece("chair", (width, depth, top + 0.1), tuple(parts))
    frame = m.carpentry(rng) if rng.random() < 0.7 else m.metal(rng)
    pad = m.fabric(rng) if rng.random() < 0.5 else frame
    thin = rng.uniform(0.025, 0.05)
    parts = legs(label, frame, width, depth, seat - 0.03, thin)
    padded = seat + rng.uniform(0.0, 0.04)
    parts.append(block(label, pad, (-0.01, 0, seat - 0.03), (width + 0.01, depth + 0.02, padded)))
    if look < 0.38:
        return Piece("stool", (width, depth, seat), tuple(parts))
    upright = m.along(frame, 2)
    if look < 0.7:
        for x in (0.0, width - thin):
            parts.append(block(label, upright, (x, -0.02, seat), (x + thin, thin - 0.02, top), tilt=0.07))
        if rng.random() < 0.5:
            count = int(rng.integers(2, 5))
            for i in range(count):
                z = seat + (top - seat) * (i + 0.7) / count
                lean = 0.06 * i / count
                parts.append(block(label, frame, (thin, -0.03 - lean, z - 0.07), (width - thin, -0.005 - lean, z)))
        else:
            for x in np.linspace(thin + 0.03, width - thin - 0.05, int(rng.integers(3, 7))):
                parts.append(block(label, upright, (x, -0.02, seat), (x + 0.02, 0.0, top - 0.05), tilt=0.07))
            parts.append(block(label, frame, (0.0, -0.05, top - 0.08), (width, -0.02, top)))
    else:
        parts.append(block(label, pad, (0.0, -0.02, seat + 0.02), (width, 0.03, top), tilt=0.1))
    if rng.random() < 0.2:
        for x in (-0.01, width - thin + 0.01):
            parts.append(block(label, frame, (x, 0.02, seat + 0.18), (x + thin, depth, seat + 0.21)))
            parts.append(block(label, upright, (x, depth - 0.05, seat), (x + thin, depth - 0.02, seat + 0.18)))
    return Piece("chair", (width, depth, top), tuple(parts))


def _table_under(
    rng: np.random.Generator, label: int, frame: Material, width: float, depth: float, height: float
) -> list[Solid]:
    """Support of a table top: legs, panels or a central post."""
    look = rng.random()
    if look < 0.65:
        thin = rng.uniform(0.035, 0.09)
        parts = legs(label, frame, width, depth, height, thin, rng.uniform(0.0, 0.05))
        if rng.random() < 0.6:
            for y in (0.04, depth - 0.07):
                parts.append(block(label, frame, (0.05, y, height - 0.09), (width - 0.05, y + 0.025, height)))
        return parts
    if look < 0.85:
        upright = m.along(frame, 2)
        return [block(label, upright, (x, 0.05, 0), (x + 0.04, depth - 0.05, height)) for x in (0.06, width - 0.1)]
    middle = (width / 2, depth / 2)
    return [post(label, frame, middle, 0.05, 0.03, height), post(label, frame, middle, 0.28, 0.0, 0.035)]


def _table(rng: np.random.Generator, name: str, width: float, depth: float, height: float, round_top: bool) -> Piece:
    label, wood = LABEL["table"], m.carpentry(rng)
    top = wood if rng.random() < 0.7 else (m.stone(rng) if rng.random() < 0.5 else m.lacquer(rng))
    thick = rng.uniform(0.02, 0.05)
    frame = wood if rng.random() < 0.7 else m.metal(rng)
    if round_top:
        middle = (width / 2, depth / 2)
        parts = [post(label, frame, middle, 0.05, 0.03, height - thick), post(label, frame, middle, 0.22, 0.0, 0.035)]
    else:
        parts = _table_under(rng, label, frame, width, depth, height - thick)
    parts.append(block(label, top, (0, 0, height - thick), (width, depth, height), CYLINDER if round_top else BOX))
    return Piece(name, (width, depth, height), tuple(parts), surface=height)


def dining_table(rng: np.random.Generator) -> Piece:
    """Rectangular or round, 0.70 to 0.78 m high."""
    round_top = bool(rng.random() < 0.25)
    width = rng.uniform(0.9, 1.3) if round_top else rng.uniform(1.0, 2.0)
    depth = width if round_top else rng.uniform(0.7, 1.0)
    return _table(rng, "table", width, depth, rng.uniform(0.7, 0.78), round_top)


def coffee_table(rng: np.random.Generator) -> Piece:
    """A low table."""
    round_top = bool(rng.random() < 0.3)
    width = rng.uniform(0.6, 1.2)
    depth = width if round_top else rng.uniform(0.45, 0.7)
    return _table(rng, "coffee table", width, depth, rng.uniform(0.35, 0.5), round_top)


def side_table(rng: np.random.Generator) -> Piece:
    """A small table beside a bed or a sofa."""
    side = rng.uniform(0.4, 0.55)
    return _table(rng, "side table", side, side, rng.uniform(0.45, 0.65), bool(rng.random() < 0.4))


def desk(rng: np.random.Generator) -> Piece:
    """A top on legs or panels, often with drawers. The screen and keyboard on it are ignored."""
    label, wood = LABEL["desk"], m.carpentry(rng)
    width, depth, height = rng.uniform(1.0, 1.8), rng.uniform(0.55, 0.8), rng.uniform(0.7, 0.78)
    parts = _table_under(rng, label, wood if rng.random() < 0.6 else m.metal(rng), width, depth, height - 0.03)
    parts.append(block(label, wood, (0, 0, height - 0.03), (width, depth, height)))
    if rng.random() < 0.6:
        x = 0.06 if rng.random() < 0.5 else width - 0.46
        body = wood if rng.random() < 0.6 else m.lacquer(rng)
        parts.append(block(label, body, (x, 0.04, 0.02), (x + 0.4, depth - 0.06, height - 0.03)))
        drawers = Front((x, x + 0.4), depth - 0.06, (0.03, height - 0.04), 1, int(rng.integers(2, 5)))
        parts += fronts(rng, label, body, drawers)
    if rng.random() < 0.3:
        parts.append(block(label, wood, (0.03, depth * 0.1, 0.1), (width - 0.03, depth * 0.1 + 0.02, height - 0.03)))
    if rng.random() < 0.65:
        dark = m.plain(rng, m.colour(rng, saturation=(0, 0.2), value=(0.03, 0.25)), gloss=0.4)
        x, half = width * rng.uniform(0.35, 0.65), rng.uniform(0.22, 0.34)
        parts.append(block(IGNORE, dark, (x - half, 0.14, height + 0.1), (x + half, 0.17, height + 0.1 + 1.15 * half)))
        parts.append(block(IGNORE, dark, (x - 0.03, 0.11, height), (x + 0.03, 0.14, height + 0.25)))
        parts.append(block(IGNORE, dark, (x - 0.12, 0.08, height), (x + 0.12, 0.26, height + 0.012)))
        keys, front = m.lacquer(rng), depth - 0.1
        parts.append(block(IGNORE, keys, (x - 0.2, depth - 0.24, height), (x + 0.2, front, height + 0.02)))
    return Piece("desk", (width, depth, height), tuple(parts), surface=height)


@dataclass(frozen=True)
class Front:
    """A grid of doors or drawers on the front of a body.

    Attributes:
        across: left and right edge [m].
        y: depth of the body, on which they are mounted [m].
        upwards: lower and upper edge [m].
        columns, rows: how many.
    """

    across: Range
    y: float
    upwards: Range
    columns: int
    rows: int


def fronts(rng: np.random.Generator, label: int, material: Material, front: Front) -> list[Solid]:
    """Doors or drawers with gaps between them and handles."""
    parts = []
    handle = m.metal(rng)
    bars = rng.random() < 0.6
    (left, right), (bottom, top), y = front.across, front.upwards, front.y
    width, height = (right - left) / front.columns, (top - bottom) / front.rows
    face = y + rng.uniform(0.012, 0.022)
    for column in range(front.columns):
        for line in range(front.rows):
            x, z = left + column * width, bottom + line * height
            low, high = (x + 0.004, y, z + 0.004), (x + width - 0.004, face, z + height - 0.004)
            parts.append(block(label, material, low, high))
            if height > width * 1.2:
                aside, upwards = 0.01, 0.06 if bars else 0.015
                middle, level = x + (0.06 if column % 2 else width - 0.06), z + height * (0.75 if z < 0.5 else 0.3)
            else:
                aside, upwards = min(0.1, width / 4) if bars else 0.015, 0.01
                middle, level = x + width / 2, z + height * 0.65
            low, high = (middle - aside, face, level - upwards), (middle + aside, face + 0.025, level + upwards)
            parts.append(block(label, handle, low, high))
    return parts
