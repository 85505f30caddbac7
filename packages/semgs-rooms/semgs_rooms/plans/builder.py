"""Build and furnish a room: find free places and put pieces there."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np
from jaxtyping import Float64

from semgs.data.tables.classes import IGNORE
from semgs_rooms.pieces import materials as m
from semgs_rooms.pieces import openings
from semgs_rooms.pieces.furniture import LABEL
from semgs_rooms.pieces.materials import Material
from semgs_rooms.pieces.solids import Piece, Solid, block, gather, move
from semgs_rooms.plans.floor_plan import WALL, Lamp, Opening
from semgs_rooms.plans.outlines import PARTITION, Outline, Span, Wall, Zone, around, overlap, rectangle

Footprint = Float64[np.ndarray, "4 2"]
Swap = Callable[[Piece], Piece]
"""Replaces a piece with another of the same name and footprint. A piece that it returned before, it returns unchanged."""


PROTRUDING = {"bed": 0.07, "sofa": 0.05, "corner sofa": 0.05}
"""Additional distance from the wall of pieces whose backs reach behind their origin [m]."""


@dataclass(frozen=True)
class Tabletop:
    """A surface for small things: the top of a piece at (x, y), turned by `yaw` [m, rad].

    Attributes:
        name: of the piece.
        blocked: places that are taken: left, right, near and far edge in the piece's frame [m].
    """

    name: str
    x: float
    y: float
    yaw: float
    width: float
    depth: float
    height: float
    blocked: tuple[Span, ...]


def masonry(wall: Wall, material: Material, height: float) -> list[Solid]:
    """A wall around its holes, in its frame. Its ends reach into the corners, behind the faces of its neighbours."""
    reach, thick = (0.0, 0.02) if wall.built else (WALL, WALL)
    parts = []
    for left, right, low, high in around(wall.length, 0.0, height, wall.holes):
        start, end = left - reach if left == 0.0 else left, right + reach if right == wall.length else right
        parts.append(block(LABEL["wall"], material, (start, -thick, low), (end, 0, high)))
    return parts


def lining(wall: Wall, material: Material, low: float, high: float, thick: float) -> list[Solid]:
    """A strip of a wall covered around its holes, from a lower to an upper edge, in the wall's frame."""
    strips = around(wall.length, low, high, wall.holes)
    return [
        block(LABEL["wall"], material, (left, 0, bottom), (right, thick, top)) for left, right, bottom, top in strips
    ]


def daylight(
    wall: Wall, corner: tuple[float, float], size: tuple[float, float], light: float, off: float = 0.0
) -> Opening:
    """The opening of a window with a lower left corner and a size on a wall, `off` before its face [m]."""
    (left, low), (width, tall) = corner, size
    x, y = wall.at(left + width / 2, off)
    cosine, sine = float(np.cos(wall.yaw)), float(np.sin(wall.yaw))
    along = (cosine * width / 2, sine * width / 2, 0.0)
    return Opening((x, y, low + tall / 2), (-sine, cosine, 0.0), along, tall / 2, light)


def cut_door(wall: Wall, door: Piece, left: float) -> Footprint:
    """Cut the hole of a door, `left` along a wall; returns the floor before it, which is to stay free."""
    bar, high = openings.door_hole(door)
    wall.holes.append((left + bar, left + door.size[0] - bar, 0.0, high))
    return rectangle(*wall.at(left), door.size[0], 0.75, wall.yaw)


def snug(piece: Piece) -> Piece:
    """The piece with its origin and size adjusted to contain all its parts, including handles, cushions and tilted backs."""
    solids = gather(piece.parts)
    half = (np.abs(solids.rotations) * solids.sizes[:, None] / 2).sum(-1)
    low, high = (solids.centres - half).min(axis=0), (solids.centres + half).max(axis=0)
    width, depth = float(high[0] - low[0]), float(high[1] - low[1])
    parts = tuple(move(piece.parts, (-float(low[0]), -float(low[1]), 0.0)))
    return replace(piece, parts=parts, size=(width, depth, float(high[2])))


class Builder:
    """A room in progress: what has been placed, and which places must stay free.

    Args:
        rng: source of all random choices.
        outline: the shape of the rooms.
        swap: replaces pieces as they are placed; None keeps them.
    """

    def __init__(self, rng: np.random.Generator, outline: Outline, swap: Swap | None = None) -> None:
        self.rng, self.outline, self.size, self.swap = rng, outline, outline.size, swap
        self.parts: list[Solid] = []
        self.pieces: list[tuple[int, int]] = []
        self.footprints: list[Footprint] = []
        self.kept_free: list[Footprint] = list(outline.built)
        self.windows: list[Opening] = []
        self.lamps: list[Lamp] = []
        self.surfaces: list[Tabletop] = []

    def chance(self, share: float) -> bool:
        """True with probability `share`."""
        return bool(self.rng.random() < share)

    def pick_wall(self, zone: Zone) -> Wall:
        """A random wall of a room."""
        return zone.walls[int(self.rng.integers(len(zone.walls)))]

    def exchange(self, piece: Piece) -> Piece:
        """The replacement of a piece, or the piece itself."""
        return piece if self.swap is None else self.swap(piece)

    def add(self, parts: list[Solid]) -> None:
        """Add the parts of one piece, already in the room's frame."""
        self.pieces.append((len(self.parts), len(self.parts) + len(parts)))
        self.parts += parts

    def shell(self, zone: Zone, wet: bool) -> None:
        """Build floor, ceiling (ignored) and walls of a room, with holes for doors and windows.

        Walls are painted, sometimes one in another colour, and may have skirting, and tiles or boards on their lower part.
        """
        rng, height = self.rng, self.size[2]
        (left, front), (right, back) = zone.low, zone.high
        low = (left - (PARTITION / 2 if left > -self.size[0] / 2 else WALL), front - WALL)
        high = (right + (PARTITION / 2 if right < self.size[0] / 2 else WALL), back + WALL)
        self.parts.append(block(LABEL["floor"], m.flooring(rng, wet), (*low, -WALL), (*high, 0)))
        white = m.plain(rng, m.colour(rng, (0.03, 0.2), (0, 0.08), (0.8, 0.97)), m.Noise(rng.uniform(0.01, 0.05), 0.02))
        self.parts.append(block(IGNORE, white, (*low, height), (*high, height + WALL)))
        paint = m.wall_paint(rng)
        skirting, tall = m.lacquer(rng) if self.chance(0.6) else m.wood(rng), rng.uniform(0.05, 0.13)
        has_skirting, accent = self.chance(0.8), int(rng.integers(4)) if self.chance(0.25) else -1
        lower, split = None, rng.uniform(0.8, 1.3)
        if wet and self.chance(0.65):
            lower, split = m.tiles(rng, small=self.chance(0.6)), rng.choice([split, height])
        elif self.chance(0.08):
            lower = m.boards(rng, m.colour(rng))
        for number, wall in enumerate(zone.walls):
            parts = masonry(wall, m.wall_paint(rng) if number == accent else paint, height)
            if lower is not None:
                parts += lining(wall, lower, 0.0, split, 0.006)
            if has_skirting:
                parts += lining(wall, skirting, 0.0, tall, 0.014)
            self.parts += move(parts, (*wall.start, 0.0), wall.yaw)

    def fill(self) -> None:
        """Fill the built-in blocks, slightly smaller than their walls, so that no camera starts inside one."""
        grey = m.plain(self.rng, (0.5, 0.5, 0.5))
        for corners in self.outline.built:
            (left, front), (right, back) = corners.min(axis=0) + 0.01, corners.max(axis=0) - 0.01
            low, high = (float(left), float(front), 0.0), (float(right), float(back), self.size[2])
            self.parts.append(block(LABEL["wall"], grey, low, high))

    def hang(self, wall: Wall, piece: Piece, left: float, low: float, recess: float = 0.0) -> None:
        """Hang a piece on a wall: its lower left corner is at (left, low), its back `recess` behind the wall's face [m]."""
        self.add(move(self.exchange(piece).parts, (*wall.at(left, -recess), low), wall.yaw))
        wall.taken.append((left, left + piece.size[0], low, low + piece.size[2]))

    def fits(self, footprint: Footprint, ignore_free: bool = False) -> bool:
        """Whether a footprint is inside the outer walls and overlaps no furniture, nor (unless `ignore_free`) a place to keep free."""
        half = (self.size[0] / 2 - 0.015, self.size[1] / 2 - 0.015)
        others = (*self.footprints, *(self.outline.built if ignore_free else self.kept_free))
        return bool((np.abs(footprint) <= half).all()) and not any(overlap(footprint, other) for other in others)

    def fits_structure(self, footprint: Footprint) -> bool:
        """Whether a footprint overlaps no inner wall or built-in block."""
        return not any(overlap(footprint, other) for other in self.outline.built)

    def stand(self, piece: Piece, x: float, y: float, yaw: float, margin: float = 0.02) -> bool:
        """Put a piece on the floor with its origin at (x, y). False if there is no room."""
        width, depth, _ = piece.size
        shift_x, shift_y = margin * np.cos(yaw) - margin * np.sin(yaw), margin * np.sin(yaw) + margin * np.cos(yaw)
        wide = rectangle(x - shift_x, y - shift_y, width + 2 * margin, depth + 2 * margin, yaw)
        inner = rectangle(x, y, width, depth, yaw)
        if not self.fits(inner) or any(overlap(wide, other) for other in (*self.footprints, *self.kept_free)):
            return False
        self.footprints.append(inner)
        piece = self.exchange(piece)
        self.add(move(piece.parts, (x, y, 0.0), yaw))
        if piece.surface is not None:
            self.surfaces.append(Tabletop(piece.name, x, y, yaw, width, depth, piece.surface, _standing_on(piece)))
        return True

    def beside_wall(self, wall: Wall, piece: Piece, left: float, off: float = 0.03, turn: float = 0.0) -> bool:
        """Put a piece with its back to a wall, `left` along it. False if wall or floor is taken there."""
        right = left + piece.size[0]
        if left < 0 or right > wall.length or not wall.free(left, right, 0.0, piece.size[2]):
            return False
        x, y = wall.at(left, off + abs(turn) * piece.size[0])
        if not self.stand(piece, x, y, wall.yaw + turn):
            return False
        wall.taken.append((left, right, 0.0, piece.size[2]))
        return True

    def against_wall(self, zone: Zone, piece: Piece, tries: int = 30, corner: float = 0.5) -> tuple[Wall, float] | None:
        """Put a piece with its back to a random wall, with probability `corner` at one end of it.

        Returns:
            The wall and how far along it [m]; None if no try succeeded.
        """
        rng = self.rng
        for _ in range(tries):
            wall = self.pick_wall(zone)
            slack = wall.length - piece.size[0] - 0.06
            if slack < 0:
                continue
            left = 0.03 + slack * (float(rng.integers(2)) if self.chance(corner) else rng.random())
            off = 0.025 + rng.choice([0.0, rng.uniform(0, 0.06)]) + PROTRUDING.get(piece.name, 0.0)
            turn = rng.uniform(-0.3, 0.3) if piece.name in ("armchair", "other", "chair") and self.chance(0.5) else 0.0
            if self.beside_wall(wall, piece, left, off, turn):
                return wall, left
        return None

    def in_the_open(self, zone: Zone, piece: Piece) -> tuple[float, float, float] | None:
        """Put a piece somewhere on the floor, trying the middle first; returns x, y and yaw, None if there is no room."""
        rng = self.rng
        centre = (np.array(zone.low) + zone.high) / 2
        sides = np.array(zone.high) - zone.low
        for number in range(12):
            along = 0.0 if (sides[0] > sides[1]) == (piece.size[0] > piece.size[1]) else np.pi / 2
            yaw = along + float(rng.choice([0.0, np.pi])) + (rng.uniform(-0.3, 0.3) if self.chance(0.2) else 0.0)
            middle = centre + (sides - 1.2) * rng.uniform(-0.5, 0.5, 2) * min(1.0, number / 4)
            x = float(middle[0] - (piece.size[0] * np.cos(yaw) - piece.size[1] * np.sin(yaw)) / 2)
            y = float(middle[1] - (piece.size[0] * np.sin(yaw) + piece.size[1] * np.cos(yaw)) / 2)
            if self.stand(piece, x, y, yaw, margin=0.3):
                return x, y, yaw
        return None

    def covered_area(self, zone: Zone) -> float:
        """Floor area under the furniture of a room [m2]."""
        total = 0.0
        for corners in self.footprints:
            middle = corners.mean(axis=0)
            if ((middle >= zone.low) & (middle <= zone.high)).all():
                total += float(np.linalg.norm(corners[1] - corners[0]) * np.linalg.norm(corners[2] - corners[1]))
        return total


def _standing_on(piece: Piece) -> tuple[Span, ...]:
    """Footprints of the parts above a piece's surface, in its frame."""
    assert piece.surface is not None
    above = [part for part in piece.parts if part.centre[2] + part.size[2] / 2 > piece.surface + 0.005]
    boxes = [(*part.centre[:2], part.size[0] / 2, part.size[1] / 2) for part in above]
    return tuple((x - width, x + width, y - depth, y + depth) for x, y, width, depth in boxes)
