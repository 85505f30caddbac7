"""What makes a room look lived in: curtains, pictures, rugs, lamps and clutter."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from jaxtyping import Float64

from semgs.data.tables.classes import IGNORE
from semgs_rooms.pieces import materials as m
from semgs_rooms.pieces import openings
from semgs_rooms.pieces import small_things as things
from semgs_rooms.pieces.solids import Piece, block, move, post
from semgs_rooms.plans.builder import Builder, snug
from semgs_rooms.plans.floor_plan import Lamp
from semgs_rooms.plans.outlines import Span, Wall, Zone, floor_point, rectangle


def hang_curtains(builder: Builder, wall: Wall, window: Span) -> bool:
    """Hang drapes beside a window or across it; returns whether they cover it."""
    rng, height = builder.rng, builder.size[2]
    left, right, low, high = window
    cloth_seed = int(rng.integers(1 << 30))
    bottom = rng.uniform(0.02, 0.1) if builder.chance(0.6) else max(0.02, low - 0.15)
    top = min(high + 0.12, height - 0.03)
    closed = builder.chance(0.3)
    span = (right - left) / 2 + 0.2 if closed else (right - left) * rng.uniform(0.15, 0.4) + 0.2
    hung = 0
    for start in (left - 0.2, right + 0.2 - span):
        start = min(max(start, 0.02), wall.length - span - 0.02)
        shape = rectangle(*wall.at(start, 0.02), span, 0.16, wall.yaw)
        if start < 0.0 or not builder.fits(shape, ignore_free=bottom > 1.2):
            continue
        drape = openings.curtain(np.random.default_rng(cloth_seed), span, bottom, top)
        builder.hang(wall, drape, start, 0.0)
        builder.footprints.append(shape)
        hung += 1
    return closed and hung == 2


def hang_wide_curtain(builder: Builder, zone: Zone) -> None:
    """Hang one curtain along a wall that is free, over most of its length and height, if there is such a wall."""
    rng = builder.rng
    top = builder.size[2] - rng.uniform(0.03, 0.2)
    for number in rng.permutation(len(zone.walls)):
        wall = zone.walls[int(number)]
        span = (wall.length - 0.08) * rng.uniform(0.7, 1.0)
        left = 0.04 + (wall.length - 0.08 - span) * rng.random()
        shape = rectangle(*wall.at(left, 0.02), span, 0.16, wall.yaw)
        if wall.built or span < 1.2 or not wall.free(left, left + span, 0.0, top) or not builder.fits(shape):
            continue
        builder.hang(wall, openings.curtain(rng, span, rng.uniform(0.02, 0.1), top), left, 0.0)
        builder.footprints.append(shape)
        return


def hang_pictures(builder: Builder, zone: Zone) -> None:
    """Hang pictures at eye height on free walls, some in rows."""
    rng = builder.rng
    for _ in range(int(rng.integers(1, 8))):
        piece = openings.picture(rng)
        wall = builder.pick_wall(zone)
        count = 1 + int(rng.integers(3)) * int(builder.chance(0.2) and piece.size[0] < 0.6)
        gap = rng.uniform(0.08, 0.2)
        slack = wall.length - count * (piece.size[0] + gap) - 0.3
        low = max(1.5 + rng.uniform(-0.1, 0.2) - piece.size[2] / 2, 0.5)
        if slack < 0 or low + piece.size[2] > builder.size[2] - 0.1:
            continue
        left = 0.15 + slack * rng.random()
        for number in range(count):
            start = left + number * (piece.size[0] + gap)
            if wall.free(start - 0.05, start + piece.size[0] + 0.05, low - 0.05, low + piece.size[2] + 0.05):
                builder.hang(wall, piece, start, low)


def lay_rug(
    builder: Builder, zone: Zone, middle: Float64[np.ndarray, " 2"], yaw: float, width: float | None = None
) -> None:
    """Lay a flat rug (ignored) around a place, under any furniture there, as large as the room allows."""
    rng = builder.rng
    width = rng.uniform(1.2, 2.4) if width is None else width
    depth = width * rng.uniform(0.6, 0.8)
    turned = abs(np.sin(yaw)) > 0.5
    half = np.array([depth, width] if turned else [width, depth]) / 2
    left, front = (float(side) for side in np.maximum(middle - half, np.array(zone.low) + 0.05))
    right, back = (float(side) for side in np.minimum(middle + half, np.array(zone.high) - 0.05))
    if right - left < 0.5 or back - front < 0.5:
        return
    if builder.fits_structure(rectangle(left, front, right - left, back - front, 0.0)):
        builder.parts.append(block(IGNORE, m.rug(rng), (left, front, 0), (right, back, 0.008)))


def add_lamps(builder: Builder, zone: Zone, lit: bool) -> None:
    """Add a ceiling lamp or spots, sometimes a floor lamp; `lit`: they are on."""
    rng, height = builder.rng, builder.size[2]
    middle = (np.array(zone.low) + zone.high) / 2 + rng.uniform(-0.3, 0.3, 2)
    x, y = float(middle[0]), float(middle[1])
    glow = m.plain(rng, m.colour(rng, m.WARM_HUES, (0.0, 0.3), (0.8, 0.97)), emission=1.6 if lit else 0.0)
    shape = rectangle(x - 0.3, y - 0.3, 0.6, 0.6, 0.0)
    if builder.chance(0.75) and builder.fits_structure(shape):
        pendant = builder.chance(0.55)
        reach, drop = rng.uniform(0.12, 0.3), rng.uniform(0.3, 0.7) if pendant else rng.uniform(0.09, 0.14)
        drop = min(drop, height - 1.95)
        thick = rng.uniform(0.08, 0.22) if pendant else drop - 0.01
        builder.parts.append(post(IGNORE, glow, (x, y), reach, height - drop, height - drop + thick))
        if pendant:
            cord = (x - 0.01, y - 0.01, height - drop), (x + 0.01, y + 0.01, height)
            builder.parts.append(block(IGNORE, m.metal(rng), *cord))
        if lit:
            builder.lamps.append(Lamp((x, y, height - drop - 0.08), float(rng.uniform(1.2, 4.0))))
    elif lit:
        for place in rng.uniform(-0.3, 0.3, (2, 2)) * (np.array(zone.high) - zone.low) + (x, y):
            builder.lamps.append(Lamp((float(place[0]), float(place[1]), height - 0.12), float(rng.uniform(0.8, 2.0))))
    if zone.kind in ("living", "bedroom", "study", "mixed") and builder.chance(0.35):
        piece = snug(things.floor_lamp(rng, lit))
        spot = builder.against_wall(zone, piece, corner=0.8)
        if spot is not None and lit:
            wall, left = spot
            x, y = wall.at(left + piece.size[0] / 2, 0.12 + piece.size[1] / 2)
            builder.lamps.append(Lamp((x, y, piece.size[2] + 0.1), float(rng.uniform(0.5, 1.5))))


PROPER: dict[str, Callable[[np.random.Generator, float], Piece]] = {
    "desk": things.on_desk, "table": things.on_table, "coffee table": things.on_table, "counter": things.on_worktop,
    "island": things.on_worktop,
}  # fmt: skip
"""What belongs on a piece of furniture."""
PROPERLY = 0.7
"""Share of the things on such a piece that belong there."""


def scatter_clutter(builder: Builder, zone: Zone) -> None:
    """Put small things on tables and cabinets, most of them where they belong, and some on the floor."""
    rng = builder.rng
    while builder.surfaces:
        top = builder.surfaces.pop()
        taken = list(top.blocked)
        for _ in range(int(rng.integers(top.name in PROPER, 8))):
            maker = PROPER.get(top.name, things.clutter) if builder.chance(PROPERLY) else things.clutter
            thing = snug(maker(rng, rng.uniform(0.08, 0.32)))
            wide, deep = thing.size[0], thing.size[1]
            if wide > top.width - 0.08 or deep > top.depth - 0.08:
                continue
            a, b = rng.uniform(0.03, top.width - wide - 0.03), rng.uniform(0.03, top.depth - deep - 0.03)
            if any(a < right and left < a + wide and b < far and near < b + deep for left, right, near, far in taken):
                continue
            taken.append((a, a + wide, b, b + deep))
            place = floor_point((top.x, top.y), top.yaw, a, b)
            builder.add(move(builder.exchange(thing).parts, (*place, top.height), top.yaw))
    low, high = np.array(zone.low) + 0.2, np.array(zone.high) - 0.2
    for _ in range(int(rng.integers(1, 9))):
        thing = snug(things.clutter(rng, rng.uniform(0.15, 0.6)))
        x, y = rng.uniform(low, high)
        if builder.chance(0.5):
            builder.against_wall(zone, thing, tries=3)
        else:
            builder.stand(thing, float(x), float(y), rng.uniform(-np.pi, np.pi))
