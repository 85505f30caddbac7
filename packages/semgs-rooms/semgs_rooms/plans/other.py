"""The style `other`, held out for testing: long rooms furnished in zones, in a few matching colours. See `docs/rooms.md`.

It shares only the parametric pieces with `home`. Proportions, walls, windows, lamps, placement and colours differ. Models are
selected on it, so nothing may be trained on it.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from jaxtyping import Float64

from semgs.data.tables.classes import IGNORE
from semgs_rooms.pieces import fittings, furniture, openings
from semgs_rooms.pieces import materials as m
from semgs_rooms.pieces import small_things as things
from semgs_rooms.pieces import texture_kernels as t
from semgs_rooms.pieces.furniture import LABEL, Maker
from semgs_rooms.pieces.materials import Material
from semgs_rooms.pieces.solids import Piece, Solid, block, move, post
from semgs_rooms.plans.builder import Swap, cut_door, daylight, lining, masonry
from semgs_rooms.plans.floor_plan import WALL, FloorPlan, Lamp, Opening
from semgs_rooms.plans.outlines import Wall, floor_point, overlap, rectangle, rectangular

ZONES = ("sleeping", "sitting", "working", "eating", "cooking", "bathing", "storing")
ZONE_LENGTH = 2.3
"""Approximate length of a zone [m]."""
ALONG, OPPOSITE = 0, 2
"""The long walls."""


@dataclass(frozen=True)
class Palette:
    """The few colours of a room.

    Attributes:
        wood, dark: colours of the wood.
        paint: colour of painted furniture.
        walls: colours of the long walls and of the end walls.
    """

    wood: tuple[float, float, float]
    dark: tuple[float, float, float]
    paint: tuple[float, float, float]
    walls: tuple[tuple[float, float, float], tuple[float, float, float]]


def draw_palette(rng: np.random.Generator) -> Palette:
    """Colours around one hue, or white with one strong colour."""
    hue = float(rng.random())
    wood = m.colour(rng, (0.05, 0.1), (0.25, 0.6), (0.25, 0.85))
    near = (hue - 0.05, hue + 0.05)
    pale = m.colour(rng, near, (0.02, 0.15), (0.8, 0.97))
    strong = m.colour(rng, near, (0.15, 0.5), (0.35, 0.75))
    walls = [(pale, strong), (strong, pale), (pale, pale), (pale, wood)][int(rng.integers(4))]
    dark = m.colour(rng, saturation=(0, 0.1), value=(0.05, 0.25))
    paint = [pale, dark if strong in walls else strong, dark][int(rng.integers(3))]
    return Palette(wood, m.shade(rng, wood, 0.3, 0.6), paint, walls)


def draw_other(rng: np.random.Generator, swap: Swap | None = None) -> FloorPlan:
    """A random long room; `swap` may replace each piece with another of the same footprint."""
    length, width = rng.uniform(4.6, 8.2), rng.uniform(2.7, 4.0)
    loft = _Loft(rng, (length, width, rng.uniform(2.5, 3.7)), swap)
    loft.openings()
    loft.shell()
    count = max(2, int(length / ZONE_LENGTH))
    zones = [str(zone) for zone in rng.choice(ZONES, count, replace=False)]
    for number, zone in enumerate(zones):
        loft.zone(zone, -length / 2 + number * length / count, length / count)
    loft.row_of_pictures()
    loft.lamps()
    loft.things()
    return FloorPlan(" + ".join(zones), loft.size, tuple(loft.parts), tuple(loft.windows), tuple(loft.footprints),
                lamps=tuple(loft.lit), instances=tuple(loft.instances))  # fmt: skip


class _Loft:
    """A long room in progress. The origin is the middle of its floor."""

    def __init__(self, rng: np.random.Generator, size: tuple[float, float, float], swap: Swap | None) -> None:
        self.rng, self.size, self.swap = rng, size, swap
        self.palette = draw_palette(rng)
        self.parts: list[Solid] = []
        self.instances: list[tuple[int, int]] = []
        self.footprints: list[Float64[np.ndarray, "4 2"]] = []
        self.kept_free: list[Float64[np.ndarray, "4 2"]] = []
        self.windows: list[Opening] = []
        self.lit: list[Lamp] = []
        self.rail = 0.0  # top of the panels [m]
        self.tops: list[tuple[float, float, float, float, float, float]] = []
        self.walls = rectangular("", size).zones[0].walls

    def shell(self) -> None:
        """Build floor, ceiling (with beams) and walls in two colours, sometimes panelled or tiled on their lower part."""
        rng, (x, y, z) = self.rng, self.size
        a, b = x / 2 + WALL, y / 2 + WALL
        self.parts.append(block(LABEL["floor"], self._floor(), (-a, -b, -WALL), (a, b, 0)))
        white = m.plain(rng, (0.8, 0.79, 0.76), m.Noise(fine_scale=0.03))
        self.parts.append(block(IGNORE, white, (-a, -b, z), (a, b, z + WALL)))
        if rng.random() < 0.6:
            beam = m.patterned(rng, m.Pattern(t.WOOD, self.palette.dark, axis=1), m.Noise(fine=0.05))
            for along in np.arange(-x / 2 + rng.uniform(0.3, 0.8), x / 2 - 0.2, rng.uniform(0.7, 1.1)):
                self.parts.append(block(IGNORE, beam, (along, -b, z - 0.16), (along + 0.12, b, z)))
        look, split = rng.random(), rng.uniform(0.85, 1.5)
        lower = None
        if look < 0.3:
            lower = m.boards(rng, self.palette.paint)
        elif look < 0.5:
            lower = m.tiles(rng, small=True)
        self.rail = 0.0 if lower is None else split + 0.03
        for number, wall in enumerate(self.walls):
            noise = m.Noise(rng.uniform(0.02, 0.07), 0.02, rng.uniform(0.04, 0.12), 0.5)
            paint = m.plain(rng, self.palette.walls[number % 2], noise)
            parts = masonry(wall, paint, z)
            if lower is not None:
                rail = m.plain(rng, self.palette.paint)
                parts += lining(wall, lower, 0.0, split, 0.006) + lining(wall, rail, split, split + 0.03, 0.025)
            self.parts += move(parts, (*wall.start, 0.0), wall.yaw)

    def _floor(self) -> Material:
        rng, look = self.rng, self.rng.random()
        if look < 0.3:
            return m.stone(rng)
        if look < 0.5:
            return m.tiles(rng)
        if look < 0.8:
            dark, wood = self.palette.dark, self.palette.wood
            shape: dict = {"scale": rng.uniform(0.18, 0.3), "aspect": rng.uniform(3, 6)}
            planks = m.Pattern(t.PLANKS, wood, dark, dark, duty=0.985, variation=0.2, tint=0.6, **shape)
            return m.patterned(rng, planks, gloss=0.2)
        return m.plain(rng, self.palette.walls[1], m.Noise(0.2, 0.015, 0.1, 0.2))

    def openings(self) -> None:
        """Add a door in one end wall, and equal windows in a long wall or one large window in the other end wall."""
        rng, (_, width, height) = self.rng, self.size
        door = openings.door(rng, height)
        end = self.walls[1]
        left = float(rng.choice([0.2, width - door.size[0] - 0.2]))
        self.hang(end, door, left, 0.0)
        self.kept_free.append(cut_door(end, door, left))
        light = rng.uniform(0.15, 1.6)
        if rng.random() < 0.7:
            wall, low = self.walls[OPPOSITE], rng.uniform(0.7, 1.3)
            count, wide = int(rng.integers(2, 5)), rng.uniform(0.6, 1.1)
            gap = (wall.length - count * wide) / (count + 1)
            places = [gap + i * (gap + wide) for i in range(count)] if gap > 0.4 else []
        else:
            wall, low, wide = self.walls[3], rng.uniform(0.1, 0.9), width * rng.uniform(0.5, 0.75)
            places = [(width - wide) / 2]
        tall = min(rng.uniform(0.7, 1.5), height - low - 0.3)
        make = int(rng.integers(1 << 30))
        for left in places:
            self.hang(wall, openings.window(np.random.default_rng(make), wide, tall, light), left, low)
            wall.holes.append((left, left + wide, low, low + tall))
            self.windows.append(daylight(wall, (left, low), (wide, tall), light))
        if places and rng.random() < 0.45:
            for left in places:
                upwards = max(0.05, low - 0.3), low + tall + 0.1
                drape = openings.curtain(np.random.default_rng(make), wide * 0.3, *upwards)
                for start in (left - 0.15, left + wide + 0.15 - drape.size[0]):
                    self.footprints.append(rectangle(*wall.at(start), drape.size[0], 0.18, wall.yaw))
                    self.hang(wall, drape, start, 0.0)

    def put(self, parts: Sequence[Solid]) -> None:
        """Add the parts of one thing."""
        self.instances.append((len(self.parts), len(self.parts) + len(parts)))
        self.parts += parts

    def hang(self, wall: Wall, piece: Piece, left: float, low: float) -> None:
        """Hang a piece on a wall with its lower left corner at (left, low) [m]."""
        wall.taken.append((left, left + piece.size[0], low, low + piece.size[2]))
        self.put(move(self.tone(piece).parts, (*wall.at(left), low), wall.yaw))

    def stand(self, piece: Piece, x: float, y: float, yaw: float) -> bool:
        """Put a piece on the floor with its origin at (x, y). False if there is no room."""
        width, depth, _ = piece.size
        shape = rectangle(x, y, width, depth, yaw)
        if (np.abs(shape) > (self.size[0] / 2 - 0.03, self.size[1] / 2 - 0.03)).any():
            return False
        if any(overlap(shape, other) for other in (*self.footprints, *self.kept_free)):
            return False
        piece = self.tone(piece)
        self.footprints.append(shape)
        self.put(move(piece.parts, (x, y, 0.0), yaw))
        if piece.surface is not None:
            self.tops.append((x, y, yaw, width, depth, piece.surface))
        return True

    def tone(self, piece: Piece) -> Piece:
        """The piece, or its replacement, with wood and paint in the room's colours."""
        piece = piece if self.swap is None else self.swap(piece)
        return replace(
            piece, parts=tuple(replace(part, material=self._tone_material(part.material)) for part in piece.parts)
        )

    def _tone_material(self, material: Material) -> Material:
        kind = int(material[t.KIND])
        if kind == t.WOOD:
            colours = self.palette.wood, self.palette.dark
        elif kind == t.PLAIN and material[t.FINE] <= 0.04 and 0 < material[t.GLOSS] <= 0.35:
            colours = self.palette.paint, self.palette.paint
        else:
            return material
        material = material.copy()
        material[t.COLOUR_A : t.COLOUR_A + 3] = material[t.COLOUR_B : t.COLOUR_B + 3] = colours[0]
        material[t.COLOUR_C : t.COLOUR_C + 3] = colours[1]
        return material

    def zone(self, zone: str, start: float, length: float) -> None:
        """Furnish the stretch of the room from x = `start` [m]."""
        middle = start + length / 2
        side = ALONG if self.rng.random() < 0.65 else OPPOSITE
        getattr(self, f"_{zone}")(middle, length, side)

    def along(self, x: float, side: int) -> float:
        """Distance along a long wall of places with this x [m]."""
        return x + self.size[0] / 2 if side == ALONG else self.size[0] / 2 - x

    def at_wall(self, maker: Maker | Piece, middle: float, side: int) -> Piece | None:
        """Put a piece with its back to a long wall, centred at x = `middle`; None if there is no room."""
        piece = maker if isinstance(maker, Piece) else maker(self.rng)
        off = 0.04 + (0.1 if piece.name in ("bed", "sofa") else 0.0)
        wall = self.walls[side]
        along = self.along(middle, side) - piece.size[0] / 2
        if not wall.free(along, along + piece.size[0], 0.0, piece.size[2]):
            return None
        if not self.stand(piece, *wall.at(along, off), wall.yaw):
            return None
        wall.taken.append((along, along + piece.size[0], 0.0, piece.size[2]))
        return piece

    def facing(self, maker: Maker | Piece, middle: float, side: int, off: float) -> None:
        """Put a piece with its front towards a long wall, `off` away from it [m]."""
        piece = maker if isinstance(maker, Piece) else maker(self.rng)
        wall = self.walls[side]
        along = self.along(middle, side) + piece.size[0] / 2
        self.stand(piece, *wall.at(along, off + piece.size[1]), wall.yaw + np.pi)

    def in_line(self, makers: Sequence[Maker], start: float, end: float, side: int) -> None:
        """Put pieces side by side along a long wall, as many as fit."""
        x = start
        for maker in makers:
            piece = maker(self.rng)
            if x + piece.size[0] > end:
                continue
            if self.at_wall(piece, x + piece.size[0] / 2, side):
                x += piece.size[0] + self.rng.uniform(0.02, 0.1)

    def _sleeping(self, middle: float, length: float, side: int) -> None:
        bed = self.at_wall(furniture.bed, middle, side)
        reach = (bed.size[0] if bed else 1.0) / 2 + 0.32
        make = int(self.rng.integers(1 << 30))
        for sign in (-1, 1):
            self.at_wall(fittings.nightstand(np.random.default_rng(make)), middle + sign * reach, side)
        self.at_wall(fittings.cabinet, middle, OPPOSITE - side)

    def _sitting(self, middle: float, length: float, side: int) -> None:
        sofa = self.at_wall(furniture.sofa, middle, side)
        depth = (sofa.size[1] if sofa else 0.9) + 0.14
        self.facing(furniture.coffee_table, middle, side, depth + 0.35)
        if self.rng.random() < 0.5:
            chair = furniture.armchair(self.rng)
            for sign in (-1, 1):
                self.facing(chair, middle + sign * 0.55, side, depth + 1.35)
        else:
            self.at_wall(fittings.other, middle, OPPOSITE - side)
        if self.rng.random() < 0.7:
            y = (-1 if side == ALONG else 1) * (self.size[1] / 2 - depth - 0.6)
            self.parts.append(block(IGNORE, m.rug(self.rng), (middle - 0.9, y - 0.7, 0), (middle + 0.9, y + 0.7, 0.01)))

    def _working(self, middle: float, length: float, side: int) -> None:
        desk = self.at_wall(furniture.desk, middle, side)
        self.facing(furniture.chair, middle, side, (desk.size[1] if desk else 0.7) + 0.15)
        makers = (fittings.bookshelf, fittings.bookshelf)
        self.in_line(makers, middle - length / 2 + 0.1, middle + length / 2, OPPOSITE - side)

    def _eating(self, middle: float, length: float, side: int) -> None:
        table = furniture.dining_table(self.rng)
        chair, half = furniture.chair(self.rng), table.size[1] / 2
        if self.stand(table, middle - table.size[0] / 2, -half, 0.0):
            for along in np.linspace(-0.3, 0.3, 2) * table.size[0]:
                self.stand(chair, middle + along - chair.size[0] / 2, -half - 0.12 - chair.size[1], 0.0)
                self.stand(chair, middle + along + chair.size[0] / 2, half + 0.12 + chair.size[1], np.pi)
        self.at_wall(fittings.cabinet, middle, side)

    def _cooking(self, middle: float, length: float, side: int) -> None:
        makers = (fittings.refrigerator, fittings.counter, fittings.other)
        self.in_line(makers, middle - length / 2 + 0.05, middle + length / 2, side)
        self.at_wall(fittings.island, middle, OPPOSITE - side)

    def _bathing(self, middle: float, length: float, side: int) -> None:
        tub = self.at_wall(fittings.bathtub, middle, side)
        if tub and self.rng.random() < 0.8:
            drape = openings.shower_curtain(self.rng, tub.size[0] * 0.6, self.size[2])
            wall = self.walls[side]
            self.stand(drape, *wall.at(self.along(middle, side) - tub.size[0] / 2, tub.size[1] + 0.06), wall.yaw)
        makers = (fittings.toilet, fittings.washbasin, fittings.cabinet)
        self.in_line(makers, middle - length / 2 + 0.1, middle + length / 2, OPPOSITE - side)

    def _storing(self, middle: float, length: float, side: int) -> None:
        makers = (fittings.cabinet, fittings.bookshelf, fittings.cabinet)
        self.in_line(makers, middle - length / 2 + 0.05, middle + length / 2, side)
        self.at_wall(furniture.armchair, middle, OPPOSITE - side)

    def row_of_pictures(self) -> None:
        """Hang pictures of one size in a row at eye height, on each wall that has room."""
        rng = self.rng
        for wall in self.walls:
            piece = openings.picture(rng)
            gap, low = rng.uniform(0.08, 0.3), max(1.55 - piece.size[2] / 2, self.rail + 0.03)
            left = rng.uniform(0.2, 0.8)
            for _ in range(int(rng.integers(1, 5))):
                right = left + piece.size[0]
                if right > wall.length - 0.15 or low + piece.size[2] > self.size[2] - 0.1:
                    break
                if wall.free(left - 0.04, right + 0.04, low - 0.04, low + piece.size[2] + 0.04):
                    parts = tuple(self._other_art(part) for part in piece.parts)
                    self.hang(wall, replace(piece, parts=parts), left, low)
                left = right + gap

    def _other_art(self, part: Solid) -> Solid:
        """The part; if it is a picture, with other art."""
        art = part.material[t.KIND] in (t.LANDSCAPE, t.ABSTRACT)
        return replace(part, material=m.artwork(self.rng)) if art else part

    def lamps(self) -> None:
        """Hang globes in a row along the middle of the ceiling."""
        rng, (x, _, z) = self.rng, self.size
        lit = rng.random() < 0.5
        shade = m.plain(rng, (0.9, 0.87, 0.8), emission=1.2 if lit else 0.25)
        radius, drop = rng.uniform(0.08, 0.16), rng.uniform(0.35, 0.7)
        for along in np.linspace(-x / 2, x / 2, int(rng.integers(3, 5)))[1:-1]:
            self.parts.append(post(IGNORE, shade, (along, 0.0), radius, z - drop, z - drop + 2 * radius))
            if lit:
                self.lit.append(Lamp((float(along), 0.0, z - drop - 0.08), float(rng.uniform(1.0, 3.0))))
            self.parts.append(block(IGNORE, m.metal(rng), (along - 0.006, -0.006, z - drop), (along + 0.006, 0.006, z)))

    def things(self) -> None:
        """Put small things in rows on furniture, and a few on the floor along the walls."""
        rng = self.rng
        for x, y, yaw, width, depth, height in self.tops:
            left = 0.05
            while rng.random() < 0.75:
                thing = things.clutter(rng, rng.uniform(0.1, 0.3))
                if left + thing.size[0] > width - 0.05 or thing.size[1] > depth - 0.06:
                    break
                a, b = left, (depth - thing.size[1]) * rng.uniform(0.2, 0.8)
                thing = thing if self.swap is None else self.swap(thing)
                self.put(move(thing.parts, (*floor_point((x, y), yaw, a, b), height), yaw))
                left += thing.size[0] + rng.uniform(0.04, 0.25)
        for _ in range(int(rng.integers(0, 4))):
            thing, middle = things.clutter(rng, rng.uniform(0.2, 0.5)), rng.uniform(-0.45, 0.45) * self.size[0]
            self.at_wall(thing, middle, int(rng.choice([ALONG, OPPOSITE])))
