"""Large pieces covered with cloth: canvas wardrobes and corner sofas. The held-out world has none of these."""

from __future__ import annotations

import numpy as np

from semgs_rooms.pieces import materials as m
from semgs_rooms.pieces import texture_kernels as t
from semgs_rooms.pieces.furniture import LABEL, legs, scatter_cushions, seat_cushions
from semgs_rooms.pieces.materials import Material
from semgs_rooms.pieces.solids import BOX, CUSHION, Piece, Solid, block, post


def canvas_wardrobe(rng: np.random.Generator) -> Piece:
    """Canvas over a frame of thin poles, with one to four flaps on zips, usually white; one flap may be rolled up.

    Its class is cabinet, as that of every wardrobe; so is that of the clothes in it.
    """
    label, columns = LABEL["cabinet"], int(rng.choice([1, 2, 2, 3, 3, 4]))
    width = columns * rng.uniform(0.42, 0.5) + (0.25 if columns == 1 else 0.0)
    depth, height, foot = rng.uniform(0.4, 0.52), rng.uniform(1.5, 1.8), rng.uniform(0.02, 0.06)
    canvas, steel = _canvas(rng), m.metal(rng)
    seam = m.plain(rng, m.shade(rng, _tone(canvas), 0.35, 0.8)) if rng.random() < 0.7 else m.fabric(rng)
    front = depth - 0.02
    poles = [(x, y) for x in (0.015, width - 0.015) for y in (0.015, depth - 0.035)]
    parts = [post(label, steel, place, 0.009, 0.0, height - 0.03) for place in poles]
    parts += [
        block(label, canvas, (0, 0, foot), (width, 0.008, height - 0.02)),
        block(label, canvas, (0, 0.008, foot), (0.006, front, height - 0.02)),
        block(label, canvas, (width - 0.006, 0.008, foot), (width, front, height - 0.02)),
        block(label, canvas, (0, 0, foot), (width, front, foot + 0.01)),
        block(label, canvas, (-0.004, -0.004, height - 0.05), (width + 0.004, depth + 0.006, height), CUSHION),
        block(label, canvas, (-0.004, depth - 0.012, height - 0.13), (width + 0.004, depth + 0.004, height - 0.02)),
    ]
    open_one = int(rng.integers(columns)) if rng.random() < 0.35 else -1
    step = width / columns
    for column in range(columns):
        left, right = column * step, (column + 1) * step
        if column:
            parts.append(block(label, canvas, (left - 0.003, 0.008, foot), (left + 0.003, front, height - 0.05)))
        if column == open_one:
            parts += _clothes(rng, (left + 0.02, right - 0.02), front, (foot, height))
            low, high = (left, front - 0.02, height - 0.2), (right, front + 0.06, height - 0.1)
            parts.append(block(label, canvas, low, high, CUSHION))
        else:
            parts += _flap(rng, canvas, (left, right), front, (foot, height - 0.04))
        for x in (left + 0.012, right - 0.012):
            parts.append(block(label, seam, (x - 0.006, front, foot), (x + 0.006, front + 0.012, height - 0.1)))
    parts.append(block(label, seam, (0, front, foot + 0.03), (width, front + 0.012, foot + 0.045)))
    return Piece("canvas wardrobe", (width, depth, height), tuple(parts))


def _canvas(rng: np.random.Generator) -> Material:
    """Creased cloth, white, cream or grey in two of three cases."""
    if rng.random() < 0.66:
        base = m.colour(rng, (0.05, 0.16), (0.0, 0.1), (0.7, 0.97))
    else:
        base = m.colour(rng, saturation=(0.05, 0.6), value=(0.12, 0.7))
    return m.plain(rng, base, m.Noise(rng.uniform(0.02, 0.08), 0.004, rng.uniform(0.06, 0.16), rng.uniform(0.08, 0.25)))


def _tone(material: Material) -> m.Colour:
    red, green, blue = (float(c) for c in material[t.COLOUR_A : t.COLOUR_A + 3])
    return red, green, blue


def _flap(
    rng: np.random.Generator, canvas: Material, across: tuple[float, float], front: float, upwards: tuple[float, float]
) -> list[Solid]:
    """Hanging cloth in two to four strips that lean a little to either side, as it never hangs flat."""
    (left, right), (low, high), label = across, upwards, LABEL["cabinet"]
    count = int(rng.integers(2, 5))
    step, middle, long = (right - left) / count, (low + high) / 2, high - low
    return [
        Solid(label, canvas, (left + (i + 0.5) * step, front + 0.004, middle), (step + 0.002, 0.004, long), BOX,
             rng.uniform(-0.07, 0.07), rng.uniform(-0.004, 0.004))
        for i in range(count)
    ]  # fmt: skip


def _clothes(
    rng: np.random.Generator, across: tuple[float, float], front: float, upwards: tuple[float, float]
) -> list[Solid]:
    """What an open flap shows: shirts on a rail, or shelves with folded cloth."""
    (left, right), (low, high), label = across, upwards, LABEL["cabinet"]
    if rng.random() < 0.5:
        rail = high - 0.2
        parts = [block(label, m.metal(rng), (left, front / 2 - 0.01, rail), (right, front / 2 + 0.01, rail + 0.02))]
        x = left
        while x < right - 0.06:
            thick, long = rng.uniform(0.025, 0.06), rng.uniform(0.5, 1.1)
            parts.append(block(label, m.fabric(rng), (x, 0.05, rail - long), (x + thick, front - 0.04, rail), CUSHION))
            x += thick + rng.uniform(0.0, 0.03)
        return parts
    parts, board = [], _canvas(rng)
    for z in np.linspace(low + 0.02, high - 0.25, int(rng.integers(4, 7)))[:-1]:
        parts.append(block(label, board, (left, 0.02, z - 0.01), (right, front - 0.02, z)))
        top = z
        for _ in range(int(rng.integers(0, 5))):
            thick = rng.uniform(0.03, 0.06)
            folded = (left + 0.03, 0.05, top), (right - 0.03, front - 0.05, top + thick)
            parts.append(block(label, m.fabric(rng), *folded, CUSHION))
            top += 0.8 * thick
    return parts


def corner_sofa(rng: np.random.Generator) -> Piece:
    """A sofa for three with a chaise longue at one end, in cloth or leather."""
    label, cloth = LABEL["sofa"], upholstery(rng)
    arm, seat, depth = rng.uniform(0.1, 0.25), rng.uniform(0.6, 0.75), rng.uniform(0.85, 1.0)
    width, long = 2 * arm + 3 * seat, rng.uniform(1.4, 1.7)
    foot, base = rng.uniform(0.02, 0.12), rng.uniform(0.26, 0.32)
    top, rest = rng.uniform(0.66, 0.9), rng.uniform(0.5, 0.64)
    back, thick = rng.uniform(0.16, 0.26), rng.uniform(0.12, 0.2)
    flipped = bool(rng.random() < 0.5)
    sides = (0.0, width - arm - seat) if flipped else (width - arm - seat, 0.0)
    chaise = (0.0, arm + seat) if flipped else (sides[0], width)
    parts = [
        block(label, cloth, (0, 0, foot), (width, depth, base)),
        block(label, cloth, (chaise[0], depth, foot), (chaise[1], long, base)),
        block(label, cloth, (0, 0, base), (width, back, top)),
    ]
    parts += [block(label, cloth, (x, back, base), (x + arm, depth, rest)) for x in (0.0, width - arm)]
    parts += legs(label, m.wood(rng, 2), width, depth, foot, 0.05, 0.03)
    ends = (chaise[0] + 0.03, chaise[1] - 0.08)
    parts += [block(label, m.metal(rng), (x, long - 0.08, 0), (x + 0.05, long - 0.03, foot)) for x in ends]
    shape = CUSHION if rng.random() < 0.5 else BOX
    for i in range(3):
        x = arm + i * seat
        reach = long if abs(x + seat / 2 - (chaise[0] + chaise[1]) / 2) < 0.4 * seat else depth
        upwards = (base - 0.02, base + thick, top + 0.05)
        parts += seat_cushions(label, cloth, shape, (x, x + seat), (back, reach), upwards)
    among = (arm + 0.25, width - arm - 0.25)
    parts += scatter_cushions(rng, label, int(rng.integers(0, 4)), among, back, base + thick)
    return Piece("corner sofa", (width, long + 0.01, top + 0.05), tuple(parts))


def upholstery(rng: np.random.Generator) -> Material:
    """Cloth, or leather in brown, black, white or grey."""
    if rng.random() < 0.65:
        return m.fabric(rng)
    look = rng.random()
    saturation, value = ((0.3, 0.7), (0.1, 0.5)) if look < 0.5 else ((0.0, 0.08), (0.03, 0.95))
    base = m.colour(rng, (0.02, 0.1), saturation, value)
    return m.plain(rng, base, m.Noise(0.06, 0.006, 0.08, 0.15), gloss=rng.uniform(0.1, 0.35))
