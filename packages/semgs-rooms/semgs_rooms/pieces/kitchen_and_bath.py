"""Refrigerators, islands, glazed cabinets and washstands as homes have them. The held-out world has none of these."""

from __future__ import annotations

import numpy as np

from semgs.data.tables.classes import IGNORE
from semgs_rooms.pieces import materials as m
from semgs_rooms.pieces.fittings import basin, fridge_notes, tap
from semgs_rooms.pieces.furniture import LABEL, Front, fronts
from semgs_rooms.pieces.materials import Material, Range
from semgs_rooms.pieces.solids import CYLINDER, Piece, Solid, Triple, block, post, ring
from semgs_rooms.pieces.texture_kernels import STRIPES

CLEAR = 0.45
"""Share of glazed doors through which one looks without any reflection."""


def home_refrigerator(rng: np.random.Generator) -> Piece:
    """One to four doors and drawers in steel, black, white or a colour, with bars, recessed grips or none; 0.8 to 2 m high."""
    own, skin = LABEL["refrigerator"], _sheet(rng)
    body = skin if rng.random() < 0.5 else _enamel(rng, (0.02, 0.5))
    look = rng.random()
    if look < 0.12:
        width, height, splits = rng.uniform(0.45, 0.56), rng.uniform(0.8, 0.9), [1.0]
    elif look < 0.45:
        width, height, splits = rng.uniform(0.54, 0.76), rng.uniform(1.55, 2.0), [rng.uniform(0.28, 0.42), 1.0]
    elif look < 0.62:
        width, height, splits = rng.uniform(0.56, 0.76), rng.uniform(1.5, 1.8), [rng.uniform(0.64, 0.74), 1.0]
    elif look < 0.72:
        width, height, splits = rng.uniform(0.58, 0.7), rng.uniform(1.6, 1.9), [1.0]
    elif look < 0.86:
        width, height, splits = rng.uniform(0.8, 0.95), rng.uniform(1.68, 1.85), [1.0]
    else:
        low = rng.uniform(0.3, 0.42)
        width, height, splits = rng.uniform(0.8, 0.95), rng.uniform(1.7, 1.85), [low, 1.0]
        if rng.random() < 0.5:
            splits = [low / 2, *splits]
    depth, thick, foot, gap = rng.uniform(0.56, 0.72), rng.uniform(0.04, 0.08), rng.uniform(0.03, 0.08), 0.004
    dark = m.plain(rng, (0.012, 0.012, 0.013))
    face = depth + thick
    parts = [
        block(own, dark, (0.02, 0.03, 0), (width - 0.02, depth - 0.03, foot)),
        block(own, body, (0, 0, foot), (width, depth, height)),
        block(own, dark, (0.01, depth, foot + 0.01), (width - 0.01, depth + 0.012, height - 0.01)),
    ]
    grip = m.metal(rng) if rng.random() < 0.6 else skin
    kind, hinge = rng.random(), bool(rng.random() < 0.5)
    bottom = foot
    for number, split in enumerate(splits):
        top = foot + (height - foot) * split
        leaves = 2 if width > 0.78 and split == 1.0 else 1
        for leaf in range(leaves):
            left, right = width * leaf / leaves + gap / 2, width * (leaf + 1) / leaves - gap / 2
            door = (left, depth + 0.01, bottom + gap / 2), (right, face, top - gap / 2)
            parts.append(block(own, skin, *door))
            drawer = leaves == 1 and width > 0.78
            opens_right = leaf == 0 if leaves == 2 else hinge
            upper = number > 0 and number == len(splits) - 1
            parts += _grip(rng, own, (grip, dark), door, kind, drawer, opens_right, upper)
        bottom = top
    if width > 0.78 and rng.random() < 0.5:  # a dispenser for water, in the left one of two doors
        x, z = width * rng.uniform(0.12, 0.18), foot + (height - foot) * rng.uniform(0.55, 0.62)
        parts.append(block(own, dark, (x, face, z), (x + 0.18, face + 0.003, z + 0.32)))
        parts.append(block(own, grip, (x + 0.01, face + 0.003, z + 0.23), (x + 0.17, face + 0.006, z + 0.31)))
    if rng.random() < 0.35:
        parts += fridge_notes(rng, own, (0.1, width - 0.22), (0.6 * height, height - 0.2), face, smallest=0.03, most=6)
    return Piece("refrigerator", (width, face + 0.05, height), tuple(parts), surface=height if height < 1.2 else None)


def _sheet(rng: np.random.Generator) -> Material:
    """The skin of an appliance: brushed steel, black or dark steel, black gloss, white or a colour."""
    look = rng.random()
    if look < 0.42:
        value = rng.uniform(0.42, 0.8) if look < 0.3 else rng.uniform(0.1, 0.3)
        base = m.colour(rng, (0.08, 0.16), (0.0, 0.06), (value, value))
        brushed = m.Pattern(STRIPES, base, m.shade(rng, base, 0.93, 1.06), scale=rng.uniform(0.002, 0.006))
        return m.patterned(rng, brushed, m.Noise(0.03, 0.003, 0.1, 0.5), gloss=rng.uniform(0.4, 0.7))
    if look < 0.9:
        return _enamel(rng, (0.03, 0.14) if look < 0.6 else (0.82, 0.97))
    return m.plain(rng, m.colour(rng, saturation=(0.3, 0.8), value=(0.3, 0.85)), m.Noise(fine=0.01), gloss=0.5)


def _enamel(rng: np.random.Generator, value: Range) -> Material:
    """Smooth grey of this brightness (sRGB)."""
    base = m.colour(rng, saturation=(0, 0.05), value=value)
    return m.plain(rng, base, m.Noise(0.008, 0.01, 0.03, 0.4), gloss=rng.uniform(0.2, 0.65))


def _grip(
    rng: np.random.Generator, label: int, materials: tuple[Material, Material], door: tuple[Triple, Triple],
    kind: float, drawer: bool, opens_right: bool, upper: bool,
) -> list[Solid]:  # fmt: skip
    """The handle of a door with these outer corners: a bar on two posts (`kind` below 0.55), a dark recess, or nothing."""
    metal, dark = materials
    (left, _, bottom), (right, face, top) = door
    if kind >= 0.85:
        return []
    x = right - 0.06 if opens_right else left + 0.06
    reach = min(0.8, 0.75 * (top - bottom))
    low = bottom + 0.06 if upper else top - 0.06 - reach
    if drawer:
        z, inset = top - 0.07, 0.12 * (right - left)
        if kind >= 0.55:
            return [block(label, dark, (left + inset, face, z + 0.03), (right - inset, face + 0.002, z + 0.055))]
        posts = [block(label, metal, (x - 0.01, face, z), (x + 0.01, face + 0.03, z + 0.02)) for x in (left + inset + 0.04, right - inset - 0.04)]  # fmt: skip
        return [*posts, block(label, metal, (left + inset, face + 0.03, z), (right - inset, face + 0.05, z + 0.02))]
    if kind >= 0.55:
        x = right - 0.03 if opens_right else left + 0.005
        return [block(label, dark, (x, face, low), (x + 0.025, face + 0.002, low + 0.6 * reach))]
    posts = [block(label, metal, (x - 0.01, face, z), (x + 0.01, face + 0.03, z + 0.02)) for z in (low + 0.04, low + reach - 0.06)]  # fmt: skip
    if rng.random() < 0.5:
        return [*posts, post(label, metal, (x, face + 0.038), 0.012, low, low + reach)]
    return [*posts, block(label, metal, (x - 0.012, face + 0.03, low), (x + 0.012, face + 0.05, low + reach))]


def home_island(rng: np.random.Generator) -> Piece:
    """A kitchen island, all of it counter: panels or drawers, a worktop that may overhang at the back, run down the ends or hold a
    sink or a hob."""
    own, body = LABEL["counter"], m.carpentry(rng) if rng.random() < 0.5 else m.lacquer(rng)
    width, depth, height = rng.uniform(1.1, 2.4), rng.uniform(0.6, 1.0), rng.uniform(0.86, 0.96)
    top = m.stone(rng) if rng.random() < 0.65 else m.wood(rng)
    slab, bar = rng.uniform(0.02, 0.08), rng.uniform(0.0, 0.3) if rng.random() < 0.5 else 0.02
    ends, front, back = 0.03 + slab * (rng.random() < 0.3), depth - 0.03, min(bar, depth - 0.5)
    parts = [
        block(own, body, (ends, back, 0.08), (width - ends, front - 0.02, height - slab - 0.19)),
        block(own, m.plain(rng, (0.03, 0.03, 0.03)), (ends + 0.02, back + 0.03, 0), (width - ends - 0.02, front - 0.07, 0.08)),
    ]  # fmt: skip
    # The upper 19 cm are hollow, for a sink.
    under, over = height - slab - 0.19, height - slab
    parts += [block(own, body, (ends, y, under), (width - ends, y + 0.02, over)) for y in (back, front - 0.04)]
    sides = (ends, width - ends - 0.02)
    parts += [block(own, body, (x, back + 0.02, under), (x + 0.02, front - 0.04, over)) for x in sides]
    if ends > 0.03:
        parts += [block(own, top, (x, 0, 0), (x + slab, depth, over)) for x in (0.0, width - slab)]
    inner = width - 2 * ends
    columns = max(1, round(inner / rng.uniform(0.4, 0.9)))
    grid = Front((ends, width - ends), front - 0.02, (0.1, over - 0.01), columns, int(rng.choice([1, 1, 2, 3])))
    parts += fronts(rng, own, body, grid)
    if rng.random() < 0.4:
        for x in np.linspace(ends, width - ends, columns + 1)[:-1]:
            right = x + inner / columns - 0.02
            parts.append(block(own, body, (x + 0.02, back - 0.015, 0.1), (right, back, over - 0.06)))
    look, middle = rng.random(), width * rng.uniform(0.35, 0.65)
    if look < 0.3:
        parts += _worktop_with_sink(rng, top, (width, depth), (height - slab, height), middle, back + 0.06)
    else:
        parts.append(block(own, top, (0, 0, height - slab), (width, depth, height)))
    if 0.3 <= look < 0.45:
        glass = m.plain(rng, (0.01, 0.01, 0.012), m.Noise(fine=0.0), gloss=0.7)
        low = (middle - 0.3, max(front - 0.56, 0.05), height)
        parts.append(block(IGNORE, glass, low, (middle + 0.3, front - 0.08, height + 0.006)))
    return Piece("island", (width, depth, height), tuple(parts), surface=height)


def _worktop_with_sink(
    rng: np.random.Generator, top: Material, size: tuple[float, float], upwards: Range, middle: float, behind: float
) -> list[Solid]:
    """A worktop (counter) around one or two bowls (sink), centred along it at `middle`, with a tap in the strip `behind` the bowls, which
    may be wider."""
    own, (width, depth), (low, high) = LABEL["counter"], size, upwards
    bowls = 2 if width > 1.3 and rng.random() < 0.4 else 1
    half = (0.36 if bowls == 2 else rng.uniform(0.2, 0.32)) + 0.005
    near, far = max(behind, depth - 0.1 - rng.uniform(0.36, 0.42)), depth - 0.1
    left, right = middle - half, middle + half
    parts = ring(own, top, ((0, width), (0, depth)), ((left, right), (near, far)), (low, high))
    ware = m.metal(rng) if rng.random() < 0.7 else m.ceramic(rng)
    for number in range(bowls):
        start, end = left + 2 * half * number / bowls, left + 2 * half * (number + 1) / bowls
        parts += basin(LABEL["sink"], ware, (start, near, high - 0.18), (end, far, high + 0.006))
    return parts + tap(rng, LABEL["sink"], middle, near - 0.05, high)


def wall_cabinet(rng: np.random.Generator, width: float) -> Piece:
    """A cabinet with glazed doors and crockery, to hang on a wall; z = 0 is its lower edge."""
    body = m.carpentry(rng) if rng.random() < 0.6 else m.lacquer(rng)
    depth, height = rng.uniform(0.29, 0.36), rng.uniform(0.55, 0.85)
    parts = _glazed(rng, body, (0, 0, 0), (width, depth, height))
    return Piece("wall cabinet", (width, depth + 0.02, height), tuple(parts))


def vitrine(rng: np.random.Generator) -> Piece:
    """A standing cabinet with glazed doors above doors or drawers."""
    label, body = LABEL["cabinet"], m.carpentry(rng)
    width, depth, height = rng.uniform(0.7, 1.3), rng.uniform(0.34, 0.46), rng.uniform(1.5, 2.05)
    foot = rng.uniform(0.05, 0.12)
    split = rng.uniform(0.45, 0.9) if rng.random() < 0.8 else foot + 0.05
    parts = [block(label, body, (0.02, 0.02, 0), (width - 0.02, depth - 0.04, foot))]
    parts.append(block(label, body, (0, 0, foot), (width, depth, split)))
    columns = max(1, round(width / rng.uniform(0.4, 0.6)))
    if split > 0.4:
        doors = Front((0.01, width - 0.01), depth, (foot + 0.01, split - 0.01), columns, int(rng.integers(1, 4)))
        parts += fronts(rng, label, body, doors)
    parts += _glazed(rng, body, (0, 0, split), (width, depth, height))
    parts.append(block(label, body, (-0.02, 0, height), (width + 0.02, depth + 0.03, height + 0.03)))
    return Piece("vitrine", (width, depth + 0.04, height + 0.03), tuple(parts))


def _glazed(rng: np.random.Generator, body: Material, low: Triple, high: Triple) -> list[Solid]:
    """A cabinet with shelves and crockery behind doors of glass, with these outer corners; doors are 2 cm in front of it.

    Rays end at the first surface, so glass is either left out (it is clear) or a pane of the colour of its reflection.
    """
    label, (left, _, bottom), (right, depth, top) = LABEL["cabinet"], low, high
    upright, thick = m.along(body, 2), 0.018
    inside = body if rng.random() < 0.6 else m.lacquer(rng)
    inner_left, inner_right = left + thick, right - thick
    parts = [block(label, inside, (left, 0, bottom), (right, 0.012, top))]
    parts += [block(label, upright, (x, 0.012, bottom), (x + thick, depth, top)) for x in (left, inner_right)]
    for z in (bottom, top - thick):
        parts.append(block(label, body, (inner_left, 0.012, z), (inner_right, depth, z + thick)))
    columns, rows = max(1, round((right - left) / rng.uniform(0.35, 0.55))), max(1, round((top - bottom) / 0.32))
    step, rise = (right - left) / columns, (top - bottom - thick) / rows
    for row in range(rows):
        floor = bottom + row * rise + thick
        if row:
            parts.append(block(label, inside, (inner_left, 0.012, floor - thick), (inner_right, depth - 0.02, floor)))
        parts += crockery(rng, label, (inner_left + 0.02, inner_right - 0.02), floor, min(depth, rise) - 0.05)
    clear, bar = rng.random() < CLEAR, rng.uniform(0.035, 0.075)
    pale = rng.random() < 0.5
    tint = m.colour(rng, (0.4, 0.62), (0, 0.12), (0.6, 0.9) if pale else (0.12, 0.5))
    glass = m.plain(rng, tint, m.Noise(0.0, 0.01, rng.uniform(0.05, 0.3), 0.25), gloss=0.7)
    mullions, rails = int(rng.choice([0, 0, 1])), int(rng.choice([0, 0, 1, 2, 3]))
    for column in range(columns):
        start, end = left + column * step + 0.002, left + (column + 1) * step - 0.002
        lower, upper, far = bottom + 0.002, top - 0.002, depth + 0.02
        a, b, c, d = start + bar, end - bar, lower + bar, upper - bar  # edges of the pane
        parts += [block(label, upright, (x, depth, lower), (x + bar, far, upper)) for x in (start, b)]
        parts += [block(label, body, (a, depth, z), (b, far, z + bar)) for z in (lower, d)]
        if not clear:
            parts.append(block(label, glass, (a, depth + 0.006, c), (b, depth + 0.01, d)))
        for x in np.linspace(start, end, mullions + 2)[1:-1]:
            parts.append(block(label, upright, (x - 0.008, depth + 0.002, c), (x + 0.008, depth + 0.016, d)))
        for z in np.linspace(lower, upper, rails + 2)[1:-1]:
            parts.append(block(label, body, (a, depth + 0.003, z - 0.008), (b, depth + 0.015, z + 0.008)))
        side = start + bar / 2 if column % 2 else end - bar / 2
        parts.append(
            block(label, m.metal(rng), (side - 0.008, far, lower + 0.06), (side + 0.008, depth + 0.04, lower + 0.1))
        )
    return parts


def crockery(rng: np.random.Generator, label: int, across: Range, floor: float, room: float) -> list[Solid]:
    """Plates, bowls, cups, glasses and jars in a row on a shelf, at most `room` high and deep [m]."""
    parts: list[Solid] = []
    ware, x = m.ceramic(rng), across[0]
    while True:
        look = rng.random()
        wide = min(room, rng.uniform(0.14, 0.26) if look < 0.45 else rng.uniform(0.06, 0.12))
        if x + wide > across[1]:
            return parts
        if rng.random() < 0.75:
            y, right = 0.02, x + wide
            if look < 0.25:
                tall = min(room, rng.uniform(0.04, 0.14))
                parts.append(block(label, ware, (x, y, floor), (right, y + wide, floor + tall), CYLINDER))
            elif look < 0.45:
                tall, inset = min(room, 0.4 * wide), 0.2 * wide
                foot = (right - inset, y + wide - inset, floor + 0.4 * tall)
                parts.append(block(label, ware, (x + inset, y + inset, floor), foot, CYLINDER))
                parts.append(block(label, ware, (x, y, foot[2]), (right, y + wide, floor + tall), CYLINDER))
            else:
                tall = min(room, rng.uniform(0.07, 0.22))
                stuff = ware if look < 0.7 else m.thing(rng)
                parts.append(block(label, stuff, (x, y, floor), (right, y + wide, floor + tall), CYLINDER))
        x += wide + rng.uniform(0.005, 0.06)


def washstand(rng: np.random.Generator) -> Piece:
    """A bathroom cabinet whose top (counter) has one or two basins (sink), set in or standing on it."""
    label, own, body = LABEL["cabinet"], LABEL["sink"], m.carpentry(rng)
    width, depth, height = rng.uniform(0.7, 1.5), rng.uniform(0.46, 0.56), rng.uniform(0.74, 0.86)
    low = rng.uniform(0.2, 0.35) if rng.random() < 0.5 else 0.06
    top = m.stone(rng) if rng.random() < 0.6 else m.wood(rng)
    parts = [block(label, body, (0.01, 0, low), (width - 0.01, depth - 0.04, height - 0.19))]
    under, over, back = height - 0.19, height - 0.03, depth - 0.06
    parts += [block(label, body, (0.01, y, under), (width - 0.01, y + 0.02, over)) for y in (0.0, back)]
    parts += [block(label, body, (x, 0.02, under), (x + 0.02, back, over)) for x in (0.01, width - 0.03)]
    if low < 0.1:
        parts.append(block(label, body, (0.03, 0, 0), (width - 0.03, depth - 0.1, low)))
    columns = max(1, round(width / 0.45))
    doors = Front((0.01, width - 0.01), depth - 0.04, (low + 0.01, height - 0.04), columns, int(rng.integers(1, 3)))
    parts += fronts(rng, label, body, doors)
    middle = width * rng.uniform(0.42, 0.58)
    if rng.random() < 0.5:
        parts += _worktop_with_sink(rng, top, (width, depth), (height - 0.03, height), middle, 0.08)
        return Piece("washstand", (width, depth, height), tuple(parts), surface=height)
    parts.append(block(LABEL["counter"], top, (0, 0, height - 0.03), (width, depth, height)))
    ware = m.ceramic(rng)
    wide, tall = rng.uniform(0.36, 0.48), rng.uniform(0.1, 0.15)
    for x in (width * 0.27, width * 0.73) if width > 1.2 else (middle,):
        parts += basin(
            own, ware, (x - wide / 2, depth - 0.04 - 0.36, height), (x + wide / 2, depth - 0.04, height + tall)
        )
        parts += tap(rng, own, x, 0.05, height)
    return Piece("washstand", (width, depth, height + tall), tuple(parts), surface=height)
