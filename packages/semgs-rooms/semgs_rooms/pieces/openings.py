"""Pieces that belong to walls: doors, windows, curtains, radiators, mirrors, pictures.

Their frame has y = 0 on the wall's face and, unless stated otherwise, z = 0 on the floor.
"""

from __future__ import annotations

import numpy as np

from semgs.data.tables.classes import IGNORE
from semgs_rooms.pieces import materials as m
from semgs_rooms.pieces.furniture import LABEL
from semgs_rooms.pieces.materials import Material
from semgs_rooms.pieces.solids import Piece, Solid, block
from semgs_rooms.pieces.texture_kernels import MARBLE, MIRROR, TILES


def door(rng: np.random.Generator, room_height: float) -> Piece:
    """A closed door: a leaf 5 cm behind the wall's face, plain or panelled, a frame and a handle. See `door_hole` for its hole."""
    own, back = LABEL["door"], -0.05
    width, height = rng.uniform(0.75, 1.0), min(rng.uniform(1.95, 2.15), room_height - 0.12)
    leaf = m.lacquer(rng) if rng.random() < 0.55 else m.wood(rng, 2)
    frame = leaf if rng.random() < 0.5 else m.lacquer(rng)
    bar = rng.uniform(0.05, 0.1)
    parts = [block(own, leaf, (bar, back, 0), (width + bar, back + 0.025, height))]
    parts += [block(own, m.along(frame, 2), (x, 0, 0), (x + bar, 0.04, height + bar)) for x in (0, width + bar)]
    parts.append(block(own, frame, (bar, 0, height), (width + bar, 0.04, height + bar)))
    # Lining of the hole, from the wall's face to the leaf.
    parts += [block(own, frame, (x, back - 0.01, 0), (x + 0.012, 0, height)) for x in (bar, width + bar - 0.012)]
    parts.append(block(own, frame, (bar, back - 0.01, height - 0.012), (width + bar, 0, height)))
    if rng.random() < 0.6:
        rows, columns = int(rng.integers(1, 4)), int(rng.integers(1, 3))
        tall, wide = height / rows, width / columns
        glass = rng.random() < 0.15
        pane = m.outdoors(rng, rng.uniform(0.2, 1.0)) if glass else leaf
        for i in range(rows):
            for j in range(columns):
                x, z = bar + j * wide, i * tall
                front = back + (0.026 if glass else 0.034)
                parts.append(block(own, pane, (x + 0.1, back, z + 0.1), (x + wide - 0.1, front, z + tall - 0.08)))
    steel, side = m.metal(rng), bar + (0.07 if rng.random() < 0.5 else width - 0.07)
    parts.append(block(own, steel, (side - 0.02, back + 0.025, 0.98), (side + 0.02, back + 0.035, 1.16)))
    left, right = sorted((side, side + (0.12 if side < width / 2 else -0.12)))
    parts.append(block(own, steel, (left, back + 0.06, 1.05), (right, back + 0.08, 1.075)))
    parts.append(block(own, steel, (side - 0.01, back + 0.025, 1.05), (side + 0.01, back + 0.08, 1.075)))
    return Piece("door", (width + 2 * bar, 0.04, height + bar), tuple(parts))


def door_hole(piece: Piece) -> tuple[float, float]:
    """Width of a door's frame on each side, and height of its leaf [m]."""
    leaf = piece.parts[0]
    return leaf.centre[0] - leaf.size[0] / 2, leaf.size[2]


def passage(rng: np.random.Generator, width: float, height: float, thick: float) -> tuple[Piece, Piece | None]:
    """The lining of an opening through a wall of thickness `thick`, and sometimes a door leaf.

    The lining spans x from 0 to `width` and y from -thick - 0.02 to 0.02. The leaf's x starts at its hinge.
    """
    own = LABEL["door"]
    wood = m.lacquer(rng) if rng.random() < 0.6 else m.wood(rng, 2)
    bar, near, far = rng.uniform(0.02, 0.04), 0.015, -thick - 0.015
    lining = [block(own, m.along(wood, 2), (x, far, 0), (x + bar, near, height)) for x in (0, width - bar)]
    lining.append(block(own, wood, (bar, far, height - bar), (width - bar, near, height)))
    upright = m.along(wood, 2)
    for y in (near, far - 0.01):
        for x in (-0.05, width - 0.02):
            lining.append(block(own, upright, (x, y, 0), (x + 0.07, y + 0.01, height + 0.05)))
        lining.append(block(own, wood, (0.02, y, height - 0.02), (width - 0.02, y + 0.01, height + 0.05)))
    frame = Piece("passage", (width, thick, height), tuple(lining))
    if rng.random() < 0.35:
        return frame, None
    long, tall, steel = width - 2 * bar - 0.01, height - bar - 0.01, m.metal(rng)
    leaf = [block(own, m.along(wood, 2), (0, 0, 0.01), (long, 0.04, tall))]
    leaf += [block(own, steel, (long - 0.2, y, 1.03), (long - 0.06, y + 0.02, 1.055)) for y in (-0.05, 0.07)]
    leaf.append(block(own, steel, (long - 0.08, -0.05, 1.03), (long - 0.06, 0.09, 1.055)))
    return frame, Piece("leaf", (long, 0.04, tall), tuple(leaf))


def radiator(rng: np.random.Generator, width: float, height: float) -> Piece:
    """White ribs, as under windows; without a class."""
    white = m.plain(rng, m.colour(rng, (0.05, 0.2), (0, 0.08), (0.8, 0.97)), m.Noise(fine=0.01), gloss=0.3)
    low, deep = 0.12, rng.uniform(0.06, 0.12)
    parts = [block(IGNORE, white, (0, 0.03, low + 0.03), (width, 0.05 + deep / 3, height - 0.03))]
    step = rng.uniform(0.045, 0.09)
    rib = 0.6 * step
    parts += [
        block(IGNORE, white, (x, 0.035, low), (x + rib, 0.03 + deep, height)) for x in np.arange(0.0, width - rib, step)
    ]
    return Piece("radiator", (width, 0.03 + deep, height), tuple(parts))


def mirror(rng: np.random.Generator, width: float, height: float) -> Piece:
    """A mirror, for above a washbasin or a chest; without a class, as ScanNet's 20 have none for it. It shows blurred grey."""
    light = m.colour(rng, saturation=(0, 0.15), value=(0.45, 0.8))
    dark = m.colour(rng, saturation=(0, 0.2), value=(0.25, 0.6))
    reflection = m.Pattern(MARBLE, light, dark, scale=rng.uniform(0.8, 1.6))
    glass = m.patterned(rng, reflection, m.Noise(fine=0.0), gloss=0.7)
    glass[MIRROR] = 1
    back = block(IGNORE, m.carpentry(rng), (0, 0, 0), (width, 0.02, height))
    front = block(IGNORE, glass, (0.02, 0, 0.02), (width - 0.02, 0.024, height - 0.02))
    return Piece("mirror", (width, 0.024, height), (back, front))


def window(rng: np.random.Generator, width: float, height: float, light: float, blind: float = 0.0) -> Piece:
    """Frame, mullions, panes of radiance `light`, a sill, and a blind over the share `blind`; z = 0 is the lower edge."""
    own = LABEL["window"]
    frame = m.lacquer(rng) if rng.random() < 0.7 else m.wood(rng)
    bar = rng.uniform(0.04, 0.08)
    pane = m.outdoors(rng, light)
    parts = [block(own, pane, (bar, 0, bar), (width - bar, 0.012, height - bar))]
    parts += [block(own, m.along(frame, 2), (x, 0, 0), (x + bar, 0.05, height)) for x in (0, width - bar)]
    parts += [block(own, frame, (bar, 0, z), (width - bar, 0.05, z + bar)) for z in (0, height - bar)]
    columns, rows = max(1, round(width / rng.uniform(0.45, 1.0))), int(rng.choice([1, 1, 2, 3]))
    thin = 0.035 if columns * rows < 4 else 0.025
    for x in np.linspace(0, width, columns + 1)[1:-1]:
        parts.append(block(own, frame, (x - thin / 2, 0, bar), (x + thin / 2, 0.035, height - bar)))
    for z in np.linspace(0, height, rows + 1)[1:-1]:
        parts.append(block(own, frame, (bar, 0, z - thin / 2), (width - bar, 0.034, z + thin / 2)))
    if rng.random() < 0.6:
        parts.append(block(own, frame, (-0.05, 0, -0.03), (width + 0.05, rng.uniform(0.06, 0.1), 0.0)))
    if blind:
        colour, gap = m.colour(rng, saturation=(0, 0.2), value=(0.6, 0.95)), (0.12, 0.12, 0.12)
        slats = m.patterned(rng, m.Pattern(TILES, colour, gap, scale=rng.uniform(0.03, 0.06), aspect=1e3, duty=0.8))
        drop = height * blind
        parts.append(block(own, slats, (0.01, 0.052, height - drop), (width - 0.01, 0.06, height)))
    return Piece("window", (width, 0.1, height), tuple(parts))


def folds(
    rng: np.random.Generator, label: int, cloth: Material, width: float, low: float, high: float, y: float
) -> list[Solid]:
    """Cloth from x = 0 to `width` in zigzag folds around depth `y`."""
    count = max(3, round(width / rng.uniform(0.05, 0.085)))
    step = width / count
    angle = rng.uniform(0.5, 0.9)
    long = step / np.cos(angle) + 0.008
    size, middle = (long, 0.008, high - low), (low + high) / 2
    return [
        Solid(label, cloth, ((i + 0.5) * step, y, middle), size, yaw=angle if i % 2 else -angle) for i in range(count)
    ]


def curtain(rng: np.random.Generator, width: float, low: float, high: float) -> Piece:
    """One drape; z = 0 is the floor."""
    own = LABEL["curtain"]
    parts = folds(rng, own, m.drapery(rng), width, low, high, 0.1)
    return Piece("curtain", (width, 0.18, high), tuple(parts))


def shower_curtain(rng: np.random.Generator, width: float, room_height: float) -> Piece:
    """Light cloth on a rod."""
    own, low = LABEL["shower curtain"], rng.uniform(0.1, 0.35)
    high = min(rng.uniform(1.85, 2.05), room_height - 0.1)
    parts = folds(rng, own, m.drapery(rng), width, low, high, 0.05)
    parts.append(block(own, m.metal(rng), (0, 0.04, high), (width, 0.06, high + 0.02)))
    return Piece("shower curtain", (width, 0.1, high), tuple(parts))


def picture(rng: np.random.Generator) -> Piece:
    """A framed picture or a poster; z = 0 is the lower edge."""
    own = LABEL["picture"]
    width = rng.uniform(0.3, 1.2)
    height = width * rng.uniform(0.6, 1.5) if width < 0.8 else width * rng.uniform(0.5, 0.9)
    art = m.artwork(rng)
    if rng.random() < 0.2:
        return Piece("picture", (width, 0.01, height), (block(own, art, (0, 0, 0), (width, 0.008, height)),))
    frame = m.wood(rng) if rng.random() < 0.5 else m.lacquer(rng)
    bar, mount = rng.uniform(0.015, 0.06), rng.choice([0.0, 0.0, 0.05, 0.09])
    parts = [block(own, m.along(frame, 2), (x, 0, 0), (x + bar, 0.03, height)) for x in (0, width - bar)]
    parts += [block(own, frame, (bar, 0, z), (width - bar, 0.03, z + bar)) for z in (0, height - bar)]
    if mount and width > 0.4 and height > 0.4:
        parts.append(block(own, m.plain(rng, (0.8, 0.8, 0.77)), (bar, 0, bar), (width - bar, 0.012, height - bar)))
        bar += mount
    parts.append(block(own, art, (bar, 0, bar), (width - bar, 0.016, height - bar)))
    return Piece("picture", (width, 0.03, height), tuple(parts))
