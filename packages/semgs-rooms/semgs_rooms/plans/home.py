"""The style `home`: rooms furnished as people do."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace

import numpy as np

from semgs_rooms.pieces import cloth, fittings, furniture, kitchen_and_bath, openings
from semgs_rooms.pieces import small_things as things
from semgs_rooms.pieces.furniture import Maker
from semgs_rooms.pieces.solids import Piece, move
from semgs_rooms.plans import dressing, outlines
from semgs_rooms.plans.builder import Builder, Swap, cut_door, daylight, snug
from semgs_rooms.plans.floor_plan import FloorPlan
from semgs_rooms.plans.outlines import PARTITION, Outline, Wall, Zone, floor_point, rectangle


def _choose_from(*makers: Maker) -> Maker:
    """A maker that makes what one of these makes, each equally often."""
    return lambda rng: makers[int(rng.integers(len(makers)))](rng)


FRIDGE = _choose_from(kitchen_and_bath.home_refrigerator, kitchen_and_bath.home_refrigerator, fittings.refrigerator)
ISLAND = _choose_from(kitchen_and_bath.home_island, kitchen_and_bath.home_island, fittings.island)
WARDROBE = _choose_from(cloth.canvas_wardrobe, fittings.cabinet, fittings.cabinet)
SOFA = _choose_from(furniture.sofa, furniture.sofa, cloth.corner_sofa)
SIDEBOARD = _choose_from(kitchen_and_bath.vitrine, fittings.sideboard)
WASHSTAND = _choose_from(kitchen_and_bath.washstand, fittings.washbasin)

BIG: dict[str, tuple[Maker, ...]] = {
    "bedroom": (furniture.bed, WARDROBE, furniture.desk, fittings.bookshelf, furniture.armchair, fittings.other),
    "living": (SOFA, SIDEBOARD, fittings.bookshelf, furniture.armchair, SOFA, fittings.other, furniture.dining_table),
    "kitchen": (fittings.counter, FRIDGE, fittings.stove, ISLAND, furniture.dining_table, fittings.counter, fittings.cabinet),
    "dining": (furniture.dining_table, SIDEBOARD, fittings.cabinet, fittings.bookshelf, furniture.armchair, fittings.other),
    "bathroom": (fittings.bathtub, fittings.toilet, WASHSTAND, fittings.cabinet, fittings.other),
    "office": (furniture.desk, furniture.desk, fittings.bookshelf, fittings.cabinet, fittings.island, furniture.desk, furniture.sofa, fittings.other),
    "study": (furniture.desk, fittings.bookshelf, furniture.armchair, fittings.bookshelf, furniture.sofa, fittings.other),
    "hallway": (WARDROBE, fittings.other, furniture.side_table, fittings.bookshelf, furniture.chair),
    "mixed": (
        furniture.bed, SOFA, furniture.desk, furniture.dining_table, fittings.bookshelf, WARDROBE, fittings.counter, ISLAND, FRIDGE,
        fittings.other, furniture.armchair,
    ),
}  # fmt: skip
"""Furniture of each kind of room, most important first; `mixed` (a studio) gets a random selection."""

SHARES = {
    "bedroom": 0.19, "living": 0.19, "kitchen": 0.18, "dining": 0.06, "bathroom": 0.17, "office": 0.07, "study": 0.05,
    "hallway": 0.02, "mixed": 0.07,
}  # fmt: skip
"""How frequent each kind of room is: by how much time people spend in it and photograph it. Cameras come close to small things
instead (`semgs_rooms.sets.carried_cameras`)."""

PAIRS = (("living", "dining"), ("living", "kitchen"), ("dining", "kitchen"), ("bedroom", "study"), ("bedroom", "bathroom"), ("living", "bedroom"))  # fmt: skip
TWO_ROOMS = 0.16
"""Share of plans with two rooms joined by an opening."""

FREE_STANDING = ("table", "island")
SOFAS = ("sofa", "corner sofa")
WASHBASINS = ("washbasin", "washstand")
SOFA_IN_THE_ROOM = 0.45
"""Share of sofas with their back to the room, if there is space."""
CHAIR_AT_DESK = 0.65
"""Share of desks with a chair."""
WET = ("bathroom", "kitchen")


@dataclass(frozen=True)
class Household:
    """What homes have.

    Attributes:
        shares: how frequent each kind of room is.
        two_rooms: share of plans with two rooms joined by an opening.
        wardrobe: makes wardrobes.
        wide_curtains: share of rooms with a curtain along a whole wall.
    """

    shares: Mapping[str, float] = field(default_factory=lambda: SHARES)
    two_rooms: float = TWO_ROOMS
    wardrobe: Maker = WARDROBE
    wide_curtains: float = 0.0


USUAL = Household()


def draw_home(rng: np.random.Generator, swap: Swap | None = None, household: Household = USUAL) -> FloorPlan:
    """A random home: one room, or two joined by an opening, with furniture, light and clutter.

    `swap` may replace each piece with another of the same footprint.
    """
    outline = _draw_outline(rng, household)
    builder = Builder(rng, outline, swap)
    evening = builder.chance(0.3)
    light = rng.uniform(0.01, 0.08) if evening else float(np.exp(rng.uniform(np.log(0.2), np.log(1.8))))
    if outline.passage is not None:
        open_door(builder, outline)
    for zone in outline.zones:
        _add_doors(builder, zone)
        _add_windows(builder, zone, light)
    for zone in outline.zones:
        builder.shell(zone, zone.kind in WET)
    if outline.passage is None:  # with a passage, the only built-in block is the partition, which has a hole
        builder.fill()
    for zone in outline.zones:
        if household.wide_curtains and builder.chance(household.wide_curtains):
            dressing.hang_wide_curtain(builder, zone)
        _furnish(builder, zone, household)
        dressing.hang_pictures(builder, zone)
        dressing.add_lamps(builder, zone, lit=evening or builder.chance(0.45))
        dressing.scatter_clutter(builder, zone)
    kind = " + ".join(zone.kind for zone in outline.zones)
    return FloorPlan(kind, outline.size, tuple(builder.parts), tuple(builder.windows), tuple(builder.footprints),
                tuple(builder.pieces), tuple(builder.lamps))  # fmt: skip


def _draw_outline(rng: np.random.Generator, household: Household) -> Outline:
    """The shape of the rooms and what they are used for."""
    height = rng.uniform(2.3, 3.2) if rng.random() < 0.5 else rng.uniform(2.4, 2.65)
    if rng.random() < household.two_rooms:
        kinds = PAIRS[int(rng.integers(len(PAIRS)))]
        return outlines.two_rooms(rng, kinds, (rng.uniform(6.0, 9.0), rng.uniform(2.8, 4.4), height))
    kind = str(rng.choice(list(household.shares), p=list(household.shares.values())))
    if kind == "bathroom":
        length, width = rng.uniform(2.5, 4.2), rng.uniform(2.4, 3.4)
    elif kind == "hallway":
        length, width = rng.uniform(3.5, 7.0), rng.uniform(1.7, 2.4)
    else:
        length = rng.uniform(3.0, 7.0)
        width = rng.uniform(2.8, min(6.0, 34 / length))
    size = (float(length), float(width), float(height))
    look = rng.random()
    if look < 0.12 and min(length, width) > 2.9:
        return outlines.with_corner_built_in(rng, kind, size)
    if look < 0.27 and min(length, width) > 2.7:
        return outlines.with_breast(rng, kind, size)
    return outlines.rectangular(kind, size)


def open_door(builder: Builder, outline: Outline) -> None:
    """Add the opening between two rooms: its lining and usually a door leaf that stands open in one of them."""
    rng = builder.rng
    assert outline.passage is not None
    wide = rng.uniform(0.8, 1.0) if builder.chance(0.6) else rng.uniform(1.2, 1.8)
    high = min(rng.uniform(2.0, 2.15), builder.size[2] - 0.15)
    frame, leaf = openings.passage(rng, wide, high, PARTITION)
    for wall, middle in outline.passage:
        hole = (middle - wide / 2, middle + wide / 2, 0.0, high)
        wall.holes.append(hole)
        wall.taken.append((hole[0] - 0.1, hole[1] + 0.1, 0.0, high + 0.1))
        builder.kept_free.append(rectangle(*wall.at(hole[0]), wide, 0.85, wall.yaw))
    wall, middle = outline.passage[0]
    builder.add(move(frame.parts, (*wall.at(middle - wide / 2), 0.0), wall.yaw))
    if leaf is not None and wide < 1.1:
        wall, middle = outline.passage[int(rng.integers(2))]
        yaw = wall.yaw + rng.uniform(1.3, 1.75)
        x, y = wall.at(middle - wide / 2 + 0.04, 0.04)
        builder.add(move(leaf.parts, (x, y, 0.0), yaw))
        builder.footprints.append(rectangle(x + 0.06 * np.sin(yaw), y - 0.06 * np.cos(yaw), leaf.size[0], 0.16, yaw))


def _add_doors(builder: Builder, zone: Zone) -> None:
    """Add one or two closed doors, in a hallway up to four, and keep the floor in front of them free."""
    rng, height = builder.rng, builder.size[2]
    count = int(rng.integers(2, 5)) if zone.kind == "hallway" else 1 + int(builder.chance(0.35))
    for _ in range(count):
        door = openings.door(rng, height)
        wall = builder.pick_wall(zone)
        slack = wall.length - door.size[0] - 0.3
        if not wall.outer or slack < 0:
            continue
        left = 0.15 + slack * rng.random()
        if wall.free(left - 0.1, left + door.size[0] + 0.1, 0.0, height):
            builder.hang(wall, door, left, 0.0)
            builder.kept_free.append(cut_door(wall, door, left))


def _add_windows(builder: Builder, zone: Zone, light: float) -> None:
    """Add up to three windows in outer walls, with blinds, curtains, and a radiator below."""
    rng, height, bath = builder.rng, builder.size[2], zone.kind == "bathroom"
    count = {"bathroom": (0, 1, 1), "hallway": (0, 0, 1)}.get(zone.kind, (0, 1, 1, 2, 2, 3, 3))
    sill = float(rng.choice([0.1, rng.uniform(0.5, 1.0), rng.uniform(0.8, 1.1)])) if not bath else rng.uniform(1.1, 1.4)
    top = min(rng.uniform(1.9, 2.4), height - 0.15)
    shaded, draped = builder.chance(0.3), not bath and builder.chance(0.75)
    for _ in range(int(rng.choice(count))):
        low = sill if builder.chance(0.8) or bath else rng.uniform(0.8, 1.1)
        tall = top - low if not bath else min(rng.uniform(0.5, 0.9), height - low - 0.15)
        wall = builder.pick_wall(zone)
        width = rng.uniform(0.5, 1.0) if bath else rng.uniform(0.7, max(0.75, min(2.4, wall.length - 0.9)))
        left = 0.3 + (wall.length - width - 0.6) * rng.random()
        if not wall.outer or left < 0.3 or tall < 0.45 or not wall.free(left - 0.3, left + width + 0.3, 0.0, height):
            continue
        blind = rng.choice([0.2, 0.5, 1.0, rng.uniform(0.3, 1.0)]) if shaded else 0.0
        recess = rng.uniform(0.06, 0.1)
        builder.hang(wall, openings.window(rng, width, tall, light, blind), left, low, recess)
        wall.holes.append((left, left + width, low, low + tall))
        closed = draped and dressing.hang_curtains(builder, wall, (left, left + width, low, low + tall))
        bright = light * (1 - 0.8 * float(blind)) * (0.15 if closed else 1.0)
        builder.windows.append(daylight(wall, (left, low), (width, tall), bright, 0.06 - recess))
        if low > 0.6 and not bath and builder.chance(0.5):
            piece = openings.radiator(rng, min(width, 1.4) * rng.uniform(0.7, 1.0), low - rng.uniform(0.08, 0.2))
            builder.beside_wall(wall, piece, left + (width - piece.size[0]) / 2, 0.005)


def _furnish(builder: Builder, zone: Zone, household: Household) -> None:
    """Add the furniture for the kind of room, each piece with its companions, on at most 45 % of the floor."""
    rng = builder.rng
    makers: Sequence[Maker] = BIG[zone.kind]
    if zone.kind == "mixed":
        makers = [makers[i] for i in rng.permutation(len(makers))[: int(rng.integers(5, 10))]]
    budget = 0.45 * zone.free_area
    for place, maker in enumerate(makers):
        if zone.kind != "mixed" and place >= 3 and builder.chance(0.3):
            continue
        piece = snug((household.wardrobe if maker is WARDROBE else maker)(rng))
        if builder.covered_area(zone) + piece.size[0] * piece.size[1] <= budget:
            _place(builder, zone, piece)
    if builder.chance(0.4):
        builder.against_wall(zone, snug(furniture.chair(rng)))
    if zone.kind in ("bathroom", "hallway", "dining", "mixed") and builder.chance(0.4):
        dressing.lay_rug(builder, zone, (np.array(zone.low) + zone.high) / 2, 0.0)


def _place(builder: Builder, zone: Zone, piece: Piece) -> None:
    """Put a piece where its kind belongs, and its companions around it."""
    if piece.name in FREE_STANDING and builder.chance(0.85):
        pose = builder.in_the_open(zone, piece)
        if pose and piece.name != "island":
            _put_chairs_around(builder, piece, *pose)
        return
    if piece.name in ("refrigerator", "stove", "counter") and _continue_row(builder, zone, piece):
        return
    if piece.name in SOFAS and builder.chance(SOFA_IN_THE_ROOM) and _put_sofa_in_room(builder, zone, piece):
        return
    place = builder.against_wall(zone, piece, corner=0.15 if piece.name in ("bed", "sofa", "desk") else 0.55)
    if place is None:
        return
    wall, left = place
    if piece.name == "bed":
        _furnish_bedside(builder, zone, wall, left, piece)
    elif piece.name == "desk" and builder.chance(CHAIR_AT_DESK):
        _put_chair_at_desk(builder, wall, left, piece)
    elif piece.name == "counter":
        _hang_wall_cabinet(builder, wall, left, piece)
    elif piece.name in SOFAS:
        _furnish_sofa_front(builder, zone, wall, left, piece)
    elif piece.name == "bathtub":
        _hang_shower_curtain(builder, wall, piece)
    elif piece.name in WASHBASINS or (piece.name == "cabinet" and piece.size[2] < 1.0 and builder.chance(0.2)):
        _hang_mirror(builder, wall, left, piece)


def _hang_mirror(builder: Builder, wall: Wall, left: float, piece: Piece) -> None:
    """Hang a mirror above a washbasin or a chest, if there is room."""
    rng = builder.rng
    width, low = piece.size[0] * rng.uniform(0.7, 1.1), max(1.15, piece.size[2] + 0.2)
    mirror = openings.mirror(rng, width, rng.uniform(0.5, 0.8))
    start, high = left + (piece.size[0] - width) / 2, low + mirror.size[2]
    inside = 0.02 < start < wall.length - width - 0.02 and high < builder.size[2] - 0.1
    if inside and wall.free(start, start + width, low, high):
        builder.hang(wall, mirror, start, low)


def _continue_row(builder: Builder, zone: Zone, piece: Piece) -> bool:
    """Put a kitchen piece directly beside one already at a wall. False if there is none or no room."""
    for wall in zone.walls:
        for left, right, low, high in list(wall.taken):
            pierced = any(left < b and a < right for a, b, _, _ in wall.holes)
            if low > 0.0 or not 0.8 < high < 2.4 or right - left < 0.5 or pierced:
                continue
            for start in (right + 0.03, left - piece.size[0] - 0.03):
                if builder.beside_wall(wall, piece, start):
                    return True
    return False


def _furnish_bedside(builder: Builder, zone: Zone, wall: Wall, left: float, bed: Piece) -> None:
    """Add nightstands at one or both sides, and often a rug that extends from under the bed."""
    rng = builder.rng
    if builder.chance(0.8):
        stand = snug(fittings.nightstand(rng) if builder.chance(0.7) else furniture.side_table(rng))
        for side in (left - stand.size[0] - 0.1, left + bed.size[0] + 0.1):
            if builder.chance(0.85):
                builder.beside_wall(wall, stand, side)
    if builder.chance(0.45):
        middle = np.array(wall.at(left + bed.size[0] / 2, bed.size[1] * 0.75))
        dressing.lay_rug(builder, zone, middle, wall.yaw, bed.size[0] + rng.uniform(0.6, 1.2))


def _put_chair_at_desk(builder: Builder, wall: Wall, left: float, desk: Piece) -> None:
    """Add a chair that faces the desk, pushed back or slightly turned."""
    rng = builder.rng
    seat = snug(furniture.chair(rng))
    along = left + desk.size[0] / 2 + seat.size[0] / 2 + rng.uniform(-0.15, 0.15)
    x, y = wall.at(along, desk.size[1] + 0.14 + seat.size[1] + rng.uniform(0, 0.25))
    if not builder.stand(seat, x, y, wall.yaw + np.pi + rng.uniform(-0.4, 0.4)):
        builder.stand(seat, x, y, wall.yaw + np.pi)


def _furnish_sofa_front(builder: Builder, zone: Zone, wall: Wall, left: float, sofa: Piece) -> None:
    """Add a coffee table, a rug, and a sideboard with a television at the opposite wall if it is free."""
    rng = builder.rng
    middle = left + sofa.size[0] / 2
    if builder.chance(0.6):
        place = np.array(wall.at(middle, sofa.size[1] + 0.5))
        dressing.lay_rug(builder, zone, place, wall.yaw, sofa.size[0] * rng.uniform(0.8, 1.3))
    if builder.chance(0.8):
        low = snug(furniture.coffee_table(rng))
        x, y = wall.at(middle - low.size[0] / 2, sofa.size[1] + rng.uniform(0.35, 0.55))
        builder.stand(low, x, y, wall.yaw)
    if builder.chance(0.35):
        opposite = [other for other in zone.walls if abs(np.cos(other.yaw - wall.yaw) + 1) < 1e-6]
        if opposite:
            other = opposite[int(rng.integers(len(opposite)))]
            _put_television(builder, other, other.length * rng.uniform(0.3, 0.7))


def _put_television(builder: Builder, wall: Wall, middle: float) -> None:
    """Put a sideboard with a television at a wall, centred `middle` along it if it fits."""
    rng = builder.rng
    bench = builder.exchange(snug(fittings.sideboard(rng)))
    start = float(np.clip(middle - bench.size[0] / 2, 0.03, max(0.03, wall.length - bench.size[0] - 0.03)))
    screen = things.television(rng, min(bench.size[0] - 0.1, rng.uniform(0.8, 1.3)))
    if bench.surface is not None and builder.beside_wall(wall, bench, start):
        builder.surfaces.pop()
        x, y = wall.at(start + (bench.size[0] - screen.size[0]) / 2, 0.1)
        builder.add(move(screen.parts, (x, y, bench.surface), wall.yaw))
        wall.taken.append((start, start + bench.size[0], bench.surface, bench.surface + screen.size[2]))


def _put_sofa_in_room(builder: Builder, zone: Zone, sofa: Piece) -> bool:
    """Put a sofa away from all walls, with its front to one and its back to the room. False if there is no room behind it.

    Between it and the wall are a television, a coffee table and a rug.
    """
    rng = builder.rng
    width, depth, _ = sofa.size
    for number in rng.permutation(len(zone.walls)):
        wall = zone.walls[int(number)]
        across = abs(np.sin(wall.yaw)) > 0.5
        deep = zone.high[0] - zone.low[0] if across else zone.high[1] - zone.low[1]
        slack, off = wall.length - width - 0.6, rng.uniform(1.5, 2.6)
        if slack < 0 or off + depth + 1.0 > deep:
            continue
        left = 0.3 + slack * rng.uniform(0.15, 0.85)
        if not builder.stand(sofa, *wall.at(left + width, off + depth), wall.yaw + np.pi, margin=0.1):
            continue
        middle = left + width / 2
        if builder.chance(0.75):
            _put_television(builder, wall, middle)
        low = snug(furniture.coffee_table(rng))
        if builder.chance(0.7):
            place = wall.at(middle - low.size[0] / 2, off - rng.uniform(0.35, 0.55) - low.size[1])
            builder.stand(low, *place, wall.yaw)
        if builder.chance(0.5):
            dressing.lay_rug(
                builder, zone, np.array(wall.at(middle, off - 0.4)), wall.yaw, width * rng.uniform(0.8, 1.3)
            )
        return True
    return False


def _hang_wall_cabinet(builder: Builder, wall: Wall, left: float, counter: Piece) -> None:
    """Hang cabinets with glazed doors above a counter that has no wall cabinets, with nothing tall below them."""
    rng = builder.rng
    if counter.surface is None or not builder.chance(0.6):
        return
    piece = kitchen_and_bath.wall_cabinet(rng, counter.size[0] * rng.uniform(0.4, 1.0))
    low = rng.uniform(1.42, 1.55)
    start = left + (counter.size[0] - piece.size[0]) * float(rng.choice([0.0, 0.5, 1.0]))
    end, high = start + piece.size[0], low + piece.size[2]
    if high > builder.size[2] - 0.03 or end > wall.length or not wall.free(start, end, low, high):
        return
    builder.hang(wall, piece, start, low)
    if builder.surfaces and builder.surfaces[-1].name == "counter":
        top = builder.surfaces[-1]
        under = (start - left, end - left, 0.0, piece.size[1])
        builder.surfaces[-1] = replace(top, blocked=(*top.blocked, under))


def _hang_shower_curtain(builder: Builder, wall: Wall, tub: Piece) -> None:
    """Add a shower curtain along the open side of the tub that was placed last."""
    rng = builder.rng
    if not builder.chance(0.8):
        return
    drape = openings.shower_curtain(rng, tub.size[0] * rng.uniform(0.35, 1.0), builder.size[2])
    along = 0.0 if builder.chance(0.5) else tub.size[0] - drape.size[0]
    start, end, _, front = builder.footprints[-1]
    x, y = front + along * (end - start) / tub.size[0] + 0.01 * (front - start) / tub.size[1]
    shape = rectangle(x, y, drape.size[0], drape.size[1], wall.yaw)
    if builder.fits(shape):
        builder.add(move(builder.exchange(drape).parts, (float(x), float(y), 0.0), wall.yaw))
        builder.footprints.append(shape)


def _put_chairs_around(builder: Builder, table: Piece, x: float, y: float, yaw: float) -> None:
    """Add identical chairs around a table, some pulled out or slightly turned."""
    rng = builder.rng
    seat = snug(furniture.chair(rng))
    width, depth, _ = table.size
    count = max(1, int(width / 0.65))
    sides = [(width * (i + 0.5) / count, end, turn) for i in range(count) for end, turn in ((depth, np.pi), (0.0, 0.0))]
    sides += [(0.0, depth / 2, -np.pi / 2), (width, depth / 2, np.pi / 2)]
    for along, across, turn in sides:
        if builder.chance(0.2):
            continue
        own = turn + rng.uniform(-0.12, 0.12)
        gap = rng.uniform(0.03, 0.12) if builder.chance(0.7) else rng.uniform(0.12, 0.4)
        out = np.array([np.sin(turn), -np.cos(turn)])
        back = np.array([along, across]) + out * (seat.size[1] + gap)
        corner = back - np.array([np.cos(own), np.sin(own)]) * seat.size[0] / 2
        builder.stand(seat, *floor_point((x, y), yaw, *corner), yaw + own)
