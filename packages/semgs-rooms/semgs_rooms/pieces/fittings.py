"""Storage, kitchen and bathroom: cabinets, shelves, counters, sinks and other pieces for walls."""

from __future__ import annotations

import numpy as np

from semgs.data.tables.classes import IGNORE
from semgs_rooms.pieces import materials as m
from semgs_rooms.pieces.furniture import LABEL, Front, fronts, legs
from semgs_rooms.pieces.materials import Material, Range
from semgs_rooms.pieces.solids import BALL, BOX, CUSHION, CYLINDER, Piece, Solid, Triple, block, post, ring
from semgs_rooms.pieces.texture_kernels import STRIPES


def cabinet(rng: np.random.Generator) -> Piece:
    """A chest of drawers, a sideboard or a wardrobe."""
    return _cabinet(rng, rng.random())


def sideboard(rng: np.random.Generator) -> Piece:
    """A long low cabinet."""
    return _cabinet(rng, 0.5)


def _cabinet(rng: np.random.Generator, look: float) -> Piece:
    """A chest of drawers if `look` is below 0.4, a sideboard below 0.7, else a wardrobe."""
    label, body = LABEL["cabinet"], m.carpentry(rng)
    if look < 0.4:
        width, depth, height = rng.uniform(0.6, 1.1), rng.uniform(0.38, 0.5), rng.uniform(0.7, 1.1)
        columns, rows = int(rng.integers(1, 3)), int(rng.integers(3, 6))
    elif look < 0.7:
        width, depth, height = rng.uniform(1.1, 1.9), rng.uniform(0.38, 0.5), rng.uniform(0.5, 0.9)
        columns, rows = int(rng.integers(2, 5)), int(rng.integers(1, 3))
    else:
        width, depth, height = rng.uniform(0.8, 1.9), rng.uniform(0.5, 0.62), rng.uniform(1.7, 2.15)
        columns, rows = max(1, round(width / 0.5)), int(rng.integers(1, 3))
    foot = float(rng.choice([0.04, 0.04, 0.1, 0.15]))
    parts = [block(label, m.along(body, 2), (0, 0, foot), (width, depth, height))]
    if foot > 0.05:
        parts += legs(label, body, width, depth, foot, 0.05, 0.01)
    else:
        parts.append(block(label, body, (0.02, 0.02, 0), (width - 0.02, depth - 0.03, foot)))
    front = body if rng.random() < 0.6 else m.carpentry(rng)
    parts += fronts(rng, label, front, Front((0.01, width - 0.01), depth, (foot + 0.01, height - 0.02), columns, rows))
    if rng.random() < 0.5:
        parts.append(block(label, body, (-0.02, -0.0, height), (width + 0.02, depth + 0.025, height + 0.025)))
        height += 0.025
    return Piece("cabinet", (width, depth + 0.04, height), tuple(parts), surface=height if height < 1.2 else None)


def nightstand(rng: np.random.Generator) -> Piece:
    """A small cabinet beside a bed."""
    label, body = LABEL["cabinet"], m.carpentry(rng)
    width, depth, height = rng.uniform(0.38, 0.55), rng.uniform(0.35, 0.45), rng.uniform(0.45, 0.65)
    parts = [block(label, body, (0, 0, 0.05), (width, depth, height)), *legs(label, body, width, depth, 0.05, 0.04)]
    drawers = Front((0.01, width - 0.01), depth, (0.06, height - 0.02), 1, int(rng.integers(1, 4)))
    parts += fronts(rng, label, body, drawers)
    return Piece("nightstand", (width, depth + 0.04, height), tuple(parts), surface=height)


def bookshelf(rng: np.random.Generator) -> Piece:
    """Sides, boards, usually a back, and books with gaps and things between them."""
    label, wood = LABEL["bookshelf"], m.carpentry(rng)
    width, depth, height = rng.uniform(0.6, 1.6), rng.uniform(0.24, 0.36), rng.uniform(0.9, 2.2)
    columns = max(1, round(width / rng.uniform(0.55, 0.9)))
    rows = max(2, round(height / rng.uniform(0.3, 0.42)))
    upright = m.along(wood, 2)
    places = np.linspace(0.011, width - 0.011, columns + 1)
    parts = [block(label, upright, (x - 0.011, 0, 0), (x + 0.011, depth, height)) for x in places]
    levels = np.linspace(0.06, height - 0.012, rows + 1)
    parts += [block(label, wood, (0.0, 0.004, z - 0.012), (width, depth - 0.006, z + 0.012)) for z in levels]
    if rng.random() < 0.8:
        parts.append(block(label, upright, (0, 0, 0), (width, 0.012, height)))
    gap = (width - 0.022) / columns
    for line in range(rows):
        low, room = levels[line] + 0.012, levels[line + 1] - levels[line] - 0.03
        for column in range(columns):
            left, right = 0.03 + column * gap, (column + 1) * gap - 0.01
            if rng.random() < 0.12:
                continue
            x = left
            while x < right - 0.08:
                span, tall = min(rng.uniform(0.1, 0.5), right - x), min(room, rng.uniform(0.17, 0.3))
                inset, look = rng.uniform(0.02, 0.06), rng.random()
                if look < 0.72:
                    parts.append(block(label, m.books(rng), (x, 0.03, low), (x + span, depth - inset, low + tall)))
                elif look < 0.88:
                    half, stuff = min(span, 0.22), m.thing(rng)
                    shape = (BOX, CYLINDER, BALL)[int(rng.integers(3))]
                    far = (x + half, min(depth - 0.02, 0.04 + half), low + 0.8 * tall)
                    parts.append(block(label, stuff, (x, 0.04, low), far, shape))
                x += span + rng.uniform(0.0, 0.06)
    return Piece("bookshelf", (width, depth, height), tuple(parts), surface=height if height < 1.2 else None)


def basin(label: int, material: Material, low: Triple, high: Triple) -> list[Solid]:
    """The bowl of a sink (walls of 2 cm) or the tub of a bath (5 cm): an open box of these outer corners."""
    (left, near, bottom), (right, far, top) = low, high
    thick = 0.02 if right - left < 1 else 0.05
    floor = bottom + thick
    inner = ((left + thick, right - thick), (near + thick, far - thick))
    walls = ring(label, material, ((left, right), (near, far)), inner, (floor, top))
    return [block(label, material, low, (right, far, floor)), *walls]


def tap(rng: np.random.Generator, label: int, x: float, y: float, z: float) -> list[Solid]:
    """A post and a spout towards +y."""
    steel, tall, long = m.metal(rng), rng.uniform(0.1, 0.3), rng.uniform(0.12, 0.2)
    spout = block(label, steel, (x - 0.012, y, z + tall - 0.02), (x + 0.012, y + long, z + tall + 0.004))
    return [post(label, steel, (x, y), 0.015, z, z + tall), spout]


def counter(rng: np.random.Generator) -> Piece:
    """A kitchen run: cabinets, a worktop (counter), usually with a sink, and sometimes wall cabinets."""
    label, body = LABEL["cabinet"], m.carpentry(rng) if rng.random() < 0.5 else m.lacquer(rng)
    width, depth, height = rng.uniform(1.4, 3.0), rng.uniform(0.56, 0.66), rng.uniform(0.86, 0.94)
    front = depth - 0.04
    top = m.stone(rng) if rng.random() < 0.6 else m.wood(rng)
    slab = rng.uniform(0.03, 0.06)
    own = LABEL["counter"]
    parts = [block(label, body, (0, 0, 0.1), (width, front, height - 0.2))]
    parts.append(block(label, body, (0, 0, 0), (width, front - 0.05, 0.1)))
    parts += [block(label, body, (x, 0, height - 0.2), (x + 0.02, front, height - slab)) for x in (0, width - 0.02)]
    parts.append(block(label, body, (0.02, front - 0.02, height - 0.2), (width - 0.02, front, height - slab)))
    columns = max(2, round(width / rng.uniform(0.45, 0.62)))
    doors = Front((0, width), front, (0.11, height - slab - 0.01), columns, int(rng.choice([1, 1, 2, 3])))
    parts += fronts(rng, label, body, doors)
    if rng.random() < 0.72:
        half, middle = rng.uniform(0.22, 0.38), rng.uniform(0.45, width - 0.45)
        left, right, near, far = middle - half, middle + half, 0.12, depth - 0.12
        parts += ring(own, top, ((0, width), (0, depth)), ((left, right), (near, far)), (height - slab, height))
        ware = m.metal(rng) if rng.random() < 0.6 else m.ceramic(rng)
        parts += basin(LABEL["sink"], ware, (left, near, height - 0.18), (right, far, height + 0.008))
        parts += tap(rng, LABEL["sink"], middle, 0.06, height)
    else:
        parts.append(block(own, top, (0, 0, height - slab), (width, depth, height)))
    if rng.random() < 0.5:
        parts.append(block(own, top, (0, 0, height), (width, 0.015, height + rng.uniform(0.08, 0.5))))
    tall = height
    if rng.random() < 0.45:
        low, tall = height + rng.uniform(0.5, 0.62), height + rng.uniform(1.1, 1.3)
        parts.append(block(label, body, (0, 0, low), (width, 0.32, tall)))
        parts += fronts(rng, label, body, Front((0, width), 0.32, (low + 0.005, tall - 0.005), columns, 1))
    return Piece("counter", (width, depth, tall), tuple(parts), surface=height if tall == height else None)


def island(rng: np.random.Generator) -> Piece:
    """A free-standing or reception counter, closed to the floor."""
    own = LABEL["counter"]
    width, depth, height = rng.uniform(0.9, 1.8), rng.uniform(0.5, 0.8), rng.uniform(0.88, 1.08)
    top = m.stone(rng) if rng.random() < 0.6 else m.wood(rng)
    parts = [block(own, m.carpentry(rng), (0.03, 0.03, 0), (width - 0.03, depth - 0.06, height - 0.05))]
    parts.append(block(own, top, (0, 0, height - 0.05), (width, depth, height)))
    return Piece("island", (width, depth, height), tuple(parts), surface=height)


def washbasin(rng: np.random.Generator) -> Piece:
    """A bathroom sink on a pedestal or on a small cabinet."""
    own, ware = LABEL["sink"], m.ceramic(rng)
    width, depth, height = rng.uniform(0.5, 0.8), rng.uniform(0.42, 0.52), rng.uniform(0.8, 0.88)
    if rng.random() < 0.55:
        body = m.carpentry(rng)
        parts = [block(LABEL["cabinet"], body, (0.01, 0, 0.06), (width - 0.01, depth - 0.05, height - 0.16))]
        doors = Front((0.01, width - 0.01), depth - 0.05, (0.08, height - 0.17), 2, 1)
        parts += fronts(rng, LABEL["cabinet"], body, doors)
        parts += basin(own, ware, (0, 0, height - 0.16), (width, depth, height))
    else:
        x = width / 2
        parts = [block(own, ware, (x - 0.09, 0.08, 0), (x + 0.09, 0.26, height - 0.15), CYLINDER)]
        parts += basin(own, ware, (0, 0, height - 0.17), (width, depth, height))
    parts += tap(rng, own, width / 2, 0.04, height - 0.03)
    return Piece("washbasin", (width, depth, height), tuple(parts))


def refrigerator(rng: np.random.Generator) -> Piece:
    """White, steel or coloured, with two doors."""
    own = LABEL["refrigerator"]
    look = rng.random()
    if look < 0.5:
        skin = m.plain(rng, m.colour(rng, saturation=(0, 0.06), value=(0.82, 0.97)), m.Noise(fine=0.01), gloss=0.25)
    elif look < 0.8:
        skin = m.plain(rng, m.colour(rng, saturation=(0, 0.05), value=(0.4, 0.75)), m.Noise(0.05, 0.004), gloss=0.5)
    else:
        skin = m.plain(rng, m.colour(rng, saturation=(0, 0.8), value=(0.08, 0.7)), m.Noise(fine=0.02), gloss=0.4)
    width, depth, height = rng.uniform(0.55, 0.92), rng.uniform(0.58, 0.72), rng.uniform(1.4, 1.95)
    grip, dark = m.metal(rng), m.plain(rng, (0.02, 0.02, 0.02))
    split = height * rng.uniform(0.3, 0.72)
    parts = [block(own, dark, (0.02, 0.02, 0), (width - 0.02, depth - 0.1, 0.06))]
    parts.append(block(own, skin, (0, 0, 0.05), (width, depth - 0.06, height)))
    side = 0.06 if rng.random() < 0.5 else width - 0.06
    for low, high in ((0.06, split - 0.006), (split + 0.006, height)):
        parts.append(block(own, skin, (0.0, depth - 0.05, low), (width, depth, high)))
        reach = min(0.3, 0.35 * (high - low))
        start = high - 0.08 - reach if high < height else low + 0.08
        parts.append(block(own, grip, (side - 0.012, depth, start), (side + 0.012, depth + 0.035, start + reach)))
    if rng.random() < 0.4:
        parts += fridge_notes(rng, own, (0.12, width - 0.2), (split + 0.1, height - 0.2), depth, smallest=0.04, most=5)
    return Piece("refrigerator", (width, depth + 0.035, height), tuple(parts))


def fridge_notes(
    rng: np.random.Generator, label: int, across: Range, upwards: Range, y: float, smallest: float, most: int
) -> list[Solid]:
    """One to `most` pictures on a door at depth y, with their lower left corners in two ranges [m]."""
    parts = []
    for _ in range(int(rng.integers(1, most + 1))):
        x, z = rng.uniform(*across), rng.uniform(*upwards)
        note, wide, tall = m.artwork(rng), rng.uniform(smallest, 0.12), rng.uniform(smallest + 0.01, 0.15)
        parts.append(block(label, note, (x, y, z), (x + wide, y + 0.004, z + tall)))
    return parts


def toilet(rng: np.random.Generator) -> Piece:
    """Bowl, seat, lid up or down, tank."""
    own, ware = LABEL["toilet"], m.ceramic(rng)
    width, depth, seat = rng.uniform(0.36, 0.42), rng.uniform(0.62, 0.72), rng.uniform(0.38, 0.44)
    lid = ware if rng.random() < 0.7 else m.wood(rng)
    tank = rng.uniform(0.16, 0.2)
    top = seat + rng.uniform(0.28, 0.4)
    parts = [
        block(own, ware, (width * 0.2, tank * 0.6, 0), (width * 0.8, depth * 0.8, seat * 0.75), CYLINDER),
        block(own, ware, (0.0, tank - 0.04, seat * 0.3), (width, depth, seat + 0.12), BALL),
        block(own, ware, (0.0, tank - 0.02, seat - 0.03), (width, depth, seat + 0.03), CYLINDER),
        block(own, lid, (-0.01, tank - 0.01, seat + 0.03), (width + 0.01, depth + 0.01, seat + 0.055), CYLINDER),
        block(own, ware, (-0.02, 0, seat + 0.02), (width + 0.02, tank, top)),
        block(own, ware, (-0.03, 0, top), (width + 0.03, tank + 0.015, top + 0.03)),
        block(own, ware, (width * 0.25, 0.02, 0.1), (width * 0.75, tank, seat + 0.02)),
    ]
    if rng.random() < 0.45:
        far = (width - 0.01, tank + 0.045, seat + 0.42)
        parts.append(block(own, lid, (0.01, tank + 0.02, seat + 0.04), far, CUSHION, tilt=-0.1))
    return Piece("toilet", (width, depth + 0.01, top + 0.03), tuple(parts))


def bathtub(rng: np.random.Generator) -> Piece:
    """A tub with a tap, sometimes tiled outside."""
    own, ware = LABEL["bathtub"], m.ceramic(rng)
    width, depth, height = rng.uniform(1.45, 1.75), rng.uniform(0.7, 0.82), rng.uniform(0.48, 0.62)
    parts = basin(own, ware, (0, 0, 0.1), (width, depth, height))
    parts.append(block(own, ware, (0.02, 0.02, 0), (width - 0.02, depth - 0.02, 0.1)))
    left, right, end = -0.015, width + 0.015, depth - 0.07
    rim = (
        (left, 0.0, right, 0.07),
        (left, end, right, depth + 0.015),
        (left, 0.07, 0.07, end),
        (width - 0.07, 0.07, right, end),
    )
    parts += [block(own, ware, (a, b, height), (c, d, height + 0.03)) for a, b, c, d in rim]
    if rng.random() < 0.3:
        parts.append(block(own, m.tiles(rng, small=True), (0, depth, 0), (width, depth + 0.012, height)))
    parts += tap(rng, own, width * 0.15, 0.05, height + 0.03)
    return Piece("bathtub", (width, depth + 0.015, height + 0.03), tuple(parts))


def other(rng: np.random.Generator) -> Piece:
    """Other furniture: an ottoman, a rack, a piano, a trolley, a bean bag or a stove."""
    own, look = LABEL["otherfurniture"], int(rng.integers(6))
    if look == 0:
        side, height = rng.uniform(0.45, 0.9), rng.uniform(0.36, 0.48)
        cloth, depth = m.fabric(rng), rng.uniform(0.45, 0.65)
        parts = [block(own, cloth, (0, 0, 0.06), (side, depth, height - 0.08))]
        parts.append(block(own, cloth, (0, 0, height - 0.12), (side, depth, height), CUSHION))
        parts += legs(own, m.wood(rng, 2), side, depth, 0.06, 0.05)
        return Piece("other", (side, depth, height), tuple(parts))
    if look == 1:
        width, depth, height = rng.uniform(0.6, 1.1), rng.uniform(0.35, 0.5), rng.uniform(0.9, 1.9)
        steel = m.metal(rng)
        parts = legs(own, steel, width, depth, height, 0.03)
        for z in np.linspace(0.12, height - 0.02, int(rng.integers(3, 6))):
            x, top = 0.04, z + 0.015
            parts.append(block(own, steel, (0, 0, z), (width, depth, top)))
            while x < width - 0.3:
                span, tall = rng.uniform(0.15, 0.3), rng.uniform(0.08, 0.25)
                if rng.random() < 0.7 and z + tall < height:
                    parts.append(block(IGNORE, m.thing(rng), (x, 0.05, top), (x + span, depth - 0.06, top + tall)))
                x += span + rng.uniform(0.03, 0.15)
        return Piece("other", (width, depth, height), tuple(parts))
    if look == 2:
        wood = m.plain(rng, m.colour(rng, m.WARM_HUES, (0.1, 0.7), (0.03, 0.4)), gloss=0.5)
        width, depth, height, keys = rng.uniform(1.3, 1.5), 0.6, rng.uniform(1.0, 1.25), 0.68
        ivory = m.patterned(rng, m.Pattern(STRIPES, (0.8, 0.78, 0.7), (0.02, 0.02, 0.02), scale=0.035, duty=0.62))
        parts = [
            block(own, wood, (0, 0, 0.08), (width, 0.32, height)),
            block(own, wood, (-0.01, 0, height), (width + 0.01, 0.34, height + 0.02)),
            block(own, wood, (0.02, 0.32, keys - 0.1), (width - 0.02, depth, keys)),
            block(own, ivory, (0.09, 0.4, keys), (width - 0.09, depth - 0.02, keys + 0.015)),
            block(own, wood, (0, 0, 0), (width, 0.3, 0.08)),
        ]
        feet = (0.03, width - 0.09)
        parts += [block(own, wood, (x, depth - 0.1, 0), (x + 0.06, depth - 0.03, keys - 0.1)) for x in feet]
        return Piece("other", (width, depth, height + 0.02), tuple(parts))
    if look == 3:
        width, depth, height = rng.uniform(0.5, 0.8), rng.uniform(0.35, 0.5), rng.uniform(0.7, 0.9)
        steel = m.metal(rng)
        parts = legs(own, steel, width, depth, height, 0.025)
        levels = (0.15, height * 0.55, height)
        parts += [block(own, m.carpentry(rng), (0, 0, z), (width, depth, z + 0.02)) for z in levels]
        parts.append(block(own, steel, (width, 0.02, height - 0.02), (width + 0.1, depth - 0.02, height)))
        return Piece("other", (width + 0.1, depth, height + 0.02), tuple(parts), surface=height + 0.02)
    if look == 4:
        side, height = rng.uniform(0.7, 0.95), rng.uniform(0.5, 0.75)
        cloth = m.fabric(rng)
        seat = block(own, cloth, (0, 0, -0.1), (side, side, height * 0.75), BALL)
        back = block(own, cloth, (0.06, 0.0, 0.05), (side - 0.06, side * 0.7, height), BALL)
        return Piece("other", (side, side, height), (seat, back))
    return stove(rng)


def stove(rng: np.random.Generator) -> Piece:
    """A free-standing stove with an oven; its class is otherfurniture."""
    own = LABEL["otherfurniture"]
    skin = m.lacquer(rng) if rng.random() < 0.5 else m.metal(rng)
    dark, grip = m.plain(rng, (0.015, 0.015, 0.018), gloss=0.6), m.metal(rng)
    width, depth, height = 0.6, 0.6, rng.uniform(0.85, 0.92)
    parts = [
        block(own, skin, (0, 0, 0), (width, depth, height - 0.02)),
        block(own, dark, (0, 0, height - 0.02), (width, depth, height)),
        block(own, dark, (0.07, depth, 0.3), (width - 0.07, depth + 0.012, 0.66)),
        block(own, grip, (0.06, depth + 0.012, 0.69), (width - 0.06, depth + 0.05, 0.71)),
    ]
    for x in np.linspace(0.08, width - 0.12, 5):
        parts.append(block(own, grip, (x, depth, height - 0.1), (x + 0.035, depth + 0.025, height - 0.065)))
    return Piece("stove", (width, depth + 0.05, height), tuple(parts))
