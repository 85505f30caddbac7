"""Plans: which room, which furniture, and where it stands, without two things in one place."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np
from jaxtyping import Float64

from semgs.data.classes import IGNORE
from semgs.rooms import fittings, furniture, openings
from semgs.rooms import materials as m
from semgs.rooms.footprints import Wall, overlap, rectangle
from semgs.rooms.furniture import LABEL, Maker
from semgs.rooms.solids import CYLINDER, Part, Piece, block, moved

WALL = 0.12
"""Thickness of walls, floor and ceiling [m]."""

BIG: dict[str, tuple[Maker, ...]] = {
    "bedroom": (furniture.bed, fittings.cabinet, furniture.desk, fittings.bookshelf, furniture.armchair, fittings.other),
    "living": (furniture.sofa, fittings.bookshelf, fittings.cabinet, furniture.armchair, furniture.dining_table, fittings.other, furniture.sofa),
    "kitchen": (fittings.counter, fittings.refrigerator, furniture.dining_table, fittings.island, fittings.cabinet, fittings.other),
    "bathroom": (fittings.bathtub, fittings.toilet, fittings.washbasin, fittings.cabinet, fittings.other),
    "office": (furniture.desk, furniture.desk, fittings.bookshelf, fittings.cabinet, furniture.sofa, fittings.island, fittings.other),
    "mixed": (
        furniture.bed, furniture.sofa, furniture.desk, furniture.dining_table, fittings.bookshelf, fittings.cabinet, fittings.counter,
        fittings.island, fittings.refrigerator, fittings.toilet, fittings.washbasin, fittings.bathtub, fittings.other, furniture.armchair,
    ),
}  # fmt: skip
"""What each kind of room is furnished with, most important first; of `mixed`, a random choice."""

SHARES = {"bedroom": 0.17, "living": 0.19, "kitchen": 0.19, "bathroom": 0.2, "office": 0.13, "mixed": 0.12}
"""How often each kind of room is drawn."""

FREE_STANDING = ("table", "island", "coffee table")


@dataclass(frozen=True)
class Opening:
    """A window in a wall: where its middle is, which way it faces, and its half extents [m]."""

    middle: tuple[float, float, float]
    facing: tuple[float, float, float]
    half_width: tuple[float, float, float]
    half_height: float


@dataclass(frozen=True)
class Plan:
    """A furnished room. The middle of its floor is the origin, z is up.

    Attributes:
        kind: "bedroom", "living", "kitchen", "bathroom", "office" or "mixed".
        size: inner length (x), width (y), height (z) [m].
        parts: every solid, walls included.
        windows: where day comes in.
        footprints: corners of every piece of furniture on the floor, anticlockwise [m].
    """

    kind: str
    size: tuple[float, float, float]
    parts: tuple[Part, ...]
    windows: tuple[Opening, ...]
    footprints: tuple[Float64[np.ndarray, "4 2"], ...]


def draw_plan(rng: np.random.Generator, swap: Callable[[Piece], Piece] | None = None) -> Plan:
    """A random room with its furniture; `swap` may exchange each piece for another of the same footprint."""
    kind = str(rng.choice(list(SHARES), p=list(SHARES.values())))
    small = kind == "bathroom"
    length = rng.uniform(2.5, 4.2) if small else rng.uniform(3.0, 7.0)
    width = rng.uniform(2.5, 3.6) if small else rng.uniform(2.8, min(6.0, 34 / length))
    height = rng.uniform(2.3, 3.2)
    builder = _Builder(rng, (length, width, height), swap)
    builder.shell(wet=kind in ("bathroom", "kitchen"))
    builder.doors_and_windows(kind)
    builder.furnish(kind)
    builder.curtains()
    builder.pictures()
    builder.clutter()
    return Plan(kind, builder.size, tuple(builder.parts), tuple(builder.windows), tuple(builder.footprints))


class _Builder:
    """A room that is being furnished."""

    def __init__(
        self, rng: np.random.Generator, size: tuple[float, float, float], swap: Callable[[Piece], Piece] | None = None
    ) -> None:
        self.rng = rng
        self.swap = swap
        self.size = size
        self.parts: list[Part] = []
        self.footprints: list[Float64[np.ndarray, "4 2"]] = []
        self.kept_free: list[Float64[np.ndarray, "4 2"]] = []
        self.windows: list[Opening] = []
        self.draped: list[tuple[Wall, float, float, float, float]] = []
        self.surfaces: list[tuple[float, float, float, float, float, float]] = []
        half_x, half_y = size[0] / 2, size[1] / 2
        self.walls = [
            Wall((-half_x, -half_y), 0.0, size[0]),
            Wall((half_x, -half_y), np.pi / 2, size[1]),
            Wall((half_x, half_y), np.pi, size[0]),
            Wall((-half_x, half_y), -np.pi / 2, size[1]),
        ]

    def chance(self, share: float) -> bool:
        """True in that share of the calls."""
        return bool(self.rng.random() < share)

    def shell(self, wet: bool) -> None:
        """Floor, ceiling (ignored), walls with skirting, at times an accent wall, a tiled or painted lower half, a ceiling lamp."""
        rng, (x, y, z) = self.rng, self.size
        a, b = x / 2 + WALL, y / 2 + WALL
        self.parts.append(block(LABEL["floor"], m.flooring(rng, wet), (-a, -b, -WALL), (a, b, 0)))
        white = m.row(
            rng, a=m.colour(rng, (0.03, 0.2), (0, 0.08), (0.8, 0.97)), fine=rng.uniform(0.01, 0.05), fine_scale=0.02
        )
        self.parts.append(block(IGNORE, white, (-a, -b, z), (a, b, z + WALL)))
        paint = m.wall_paint(rng)
        skirting, tall = m.lacquer(rng) if self.chance(0.6) else m.wood(rng), rng.uniform(0.05, 0.13)
        has_skirting, accent = self.chance(0.75), int(rng.integers(4)) if self.chance(0.3) else -1
        lower, split = None, rng.uniform(0.8, 1.3)
        if wet and self.chance(0.65):
            lower, split = m.tiles(rng, small=self.chance(0.6)), rng.choice([split, z])
        elif self.chance(0.1):
            lower = m.boards(rng, m.colour(rng))
        own = LABEL["wall"]
        for number, wall in enumerate(self.walls):
            own_paint = m.wall_paint(rng) if number == accent else paint
            slab = block(own, own_paint, (-WALL, -WALL, 0), (wall.length + WALL, 0, z))
            parts = [slab]
            if lower is not None:
                parts.append(block(own, lower, (0, 0, 0), (wall.length, 0.006, split)))
            if has_skirting:
                parts.append(block(own, skirting, (0, 0, 0), (wall.length, 0.014, tall)))
            self.parts += moved(parts, (*wall.start, 0.0), wall.yaw)
        if self.chance(0.6):
            shade = m.row(rng, a=(0.9, 0.85, 0.75), emission=1.3)
            reach, drop = rng.uniform(0.15, 0.3), rng.uniform(0.05, 0.5)
            self.parts.append(
                block(IGNORE, shade, (-reach, -reach, z - drop), (reach, reach, z - drop + 0.12), CYLINDER)
            )
            self.parts.append(block(IGNORE, m.metal(rng), (-0.01, -0.01, z - drop), (0.01, 0.01, z)))

    def doors_and_windows(self, kind: str) -> None:
        """One or two doors, whose swing stays free, and up to three windows."""
        rng, height = self.rng, self.size[2]
        for _ in range(1 + int(self.chance(0.35))):
            piece = openings.door(rng, height)
            wall = self.walls[int(rng.integers(4))]
            left = rng.uniform(0.15, wall.length - piece.size[0] - 0.15)
            if wall.free(left - 0.1, left + piece.size[0] + 0.1, 0.0, height):
                self.hang(wall, piece, left, 0.0)
                x, y = wall.at(left)
                self.kept_free.append(rectangle(x, y, piece.size[0], 0.75, wall.yaw))
        light = rng.uniform(0.15, 1.6)
        count = int(rng.choice([0, 1, 1]) if kind == "bathroom" else rng.choice([0, 1, 1, 2, 2, 3]))
        for _ in range(count):
            low = (
                rng.choice([0.12, rng.uniform(0.5, 1.0), rng.uniform(0.8, 1.1)])
                if kind != "bathroom"
                else rng.uniform(1.1, 1.4)
            )
            tall = rng.uniform(0.7, max(0.75, height - low - 0.25))
            tall = min(tall, height - low - 0.12)
            wall = self.walls[int(rng.integers(4))]
            width = rng.uniform(0.5, 1.0) if kind == "bathroom" else rng.uniform(0.7, min(2.4, wall.length - 0.9))
            left = rng.uniform(0.3, wall.length - width - 0.3)
            if tall < 0.45 or not wall.free(left - 0.3, left + width + 0.3, low, low + tall):
                continue
            self.hang(wall, openings.window(rng, width, tall, light), left, low)
            middle = wall.at(left + width / 2)
            facing = (-float(np.sin(wall.yaw)), float(np.cos(wall.yaw)), 0.0)
            half = (float(np.cos(wall.yaw)) * width / 2, float(np.sin(wall.yaw)) * width / 2, 0.0)
            self.windows.append(Opening((*middle, low + tall / 2), facing, half, tall / 2))
            if kind != "bathroom" and self.chance(0.75):
                self.draped.append((wall, left, left + width, low, low + tall))

    def hang(self, wall: Wall, piece: Piece, left: float, low: float) -> None:
        """Fix a piece to a wall with its lower left corner there."""
        x, y = wall.at(left)
        piece = piece if self.swap is None else self.swap(piece)
        self.parts += moved(piece.parts, (x, y, low), wall.yaw)
        wall.taken.append((left, left + piece.size[0], low, low + piece.size[2]))

    def stand(self, piece: Piece, x: float, y: float, yaw: float, margin: float = 0.02) -> bool:
        """Put a piece on the floor with its own (0, 0) at (x, y), if there is room for it."""
        width, depth, _ = piece.size
        shift_x, shift_y = margin * np.cos(yaw) - margin * np.sin(yaw), margin * np.sin(yaw) + margin * np.cos(yaw)
        wide = rectangle(x - shift_x, y - shift_y, width + 2 * margin, depth + 2 * margin, yaw)
        half_x, half_y = self.size[0] / 2 - 0.015, self.size[1] / 2 - 0.015
        inner = rectangle(x, y, width, depth, yaw)
        if (np.abs(inner) > (half_x, half_y)).any():
            return False
        if any(overlap(wide, other) for other in (*self.footprints, *self.kept_free)):
            return False
        self.footprints.append(inner)
        piece = piece if self.swap is None else self.swap(piece)
        self.parts += moved(piece.parts, (x, y, 0.0), yaw)
        if piece.surface is not None:
            self.surfaces.append((x, y, yaw, width, depth, piece.surface))
        return True

    def against_wall(self, piece: Piece, tries: int = 30) -> tuple[Wall, float] | None:
        """Put a piece with its back to some wall; returns the wall and where on it, None if it found no room."""
        rng = self.rng
        for _ in range(tries):
            wall = self.walls[int(rng.integers(4))]
            slack = wall.length - piece.size[0] - 0.06
            if slack < 0:
                continue
            left = 0.03 + slack * float(rng.choice([0.0, 1.0, rng.random(), rng.random()]))
            off = 0.025 + rng.choice([0.0, rng.uniform(0, 0.06)]) + (0.07 if piece.name == "bed" else 0.0)
            if piece.name == "sofa":
                off += 0.05
            if not wall.free(left, left + piece.size[0], 0.0, piece.size[2]):
                continue
            turn = rng.uniform(-0.05, 0.05) if piece.name in ("armchair", "other", "chair") else 0.0
            x, y = wall.at(left, off + abs(turn) * piece.size[0])
            if self.stand(piece, x, y, wall.yaw + turn):
                wall.taken.append((left, left + piece.size[0], 0.0, piece.size[2]))
                return wall, left
        return None

    def in_the_open(self, piece: Piece, tries: int = 10) -> tuple[float, float, float] | None:
        """Put a piece somewhere on the floor; returns its place and yaw, None if it found no room."""
        rng = self.rng
        for _ in range(tries):
            yaw = float(rng.choice([0.0, np.pi / 2, np.pi, -np.pi / 2])) + (
                rng.uniform(-0.3, 0.3) if self.chance(0.3) else 0.0
            )
            middle_x, middle_y = (rng.uniform(-0.5, 0.5) * (side - 1.2) for side in self.size[:2])
            x = middle_x - (piece.size[0] * np.cos(yaw) - piece.size[1] * np.sin(yaw)) / 2
            y = middle_y - (piece.size[0] * np.sin(yaw) + piece.size[1] * np.cos(yaw)) / 2
            if self.stand(piece, x, y, yaw, margin=0.3):
                return x, y, yaw
        return None

    def furnish(self, kind: str) -> None:
        """The furniture of a kind of room, each piece with what goes with it, up to two fifths of the floor."""
        rng = self.rng
        makers: Sequence[Maker] = BIG[kind]
        if kind == "mixed":
            makers = [makers[i] for i in rng.permutation(len(makers))[: int(rng.integers(5, 10))]]
        budget = 0.42 * self.size[0] * self.size[1]
        for place, maker in enumerate(makers):
            if kind != "mixed" and place >= 3 and self.chance(0.35):
                continue
            piece = maker(rng)
            area = sum(float(np.linalg.norm(f[1] - f[0]) * np.linalg.norm(f[2] - f[1])) for f in self.footprints)
            if area + piece.size[0] * piece.size[1] > budget:
                continue
            self.place(piece)
        if self.chance(0.5):
            self.against_wall(furniture.chair(rng))
        if kind in ("bedroom", "living", "office", "mixed") and self.chance(0.55):
            self.rug()

    def place(self, piece: Piece) -> None:
        """Put a piece where its kind belongs, with its companions."""
        rng = self.rng
        if piece.name in FREE_STANDING and self.chance(0.75):
            found = self.in_the_open(piece)
            if found and piece.name != "island":
                self.chairs_around(piece, *found)
            return
        where = self.against_wall(piece)
        if where is None:
            return
        wall, left = where
        if piece.name == "bed" and self.chance(0.7):
            stand = fittings.nightstand(rng) if self.chance(0.6) else furniture.side_table(rng)
            for side in (left - stand.size[0] - 0.12, left + piece.size[0] + 0.12):
                if (
                    side > 0
                    and side + stand.size[0] < wall.length
                    and wall.free(side, side + stand.size[0], 0.0, stand.size[2])
                ):
                    x, y = wall.at(side, 0.03)
                    if self.stand(stand, x, y, wall.yaw):
                        wall.taken.append((side, side + stand.size[0], 0.0, stand.size[2]))
        elif piece.name == "desk":
            seat = furniture.chair(rng)
            x, y = wall.at(
                left + piece.size[0] / 2 + seat.size[0] / 2, piece.size[1] + 0.12 + seat.size[1] + rng.uniform(0, 0.25)
            )
            self.stand(seat, x, y, wall.yaw + np.pi)
        elif piece.name == "sofa" and self.chance(0.75):
            low = furniture.coffee_table(rng)
            x, y = wall.at(left + (piece.size[0] - low.size[0]) / 2, piece.size[1] + rng.uniform(0.35, 0.55))
            self.stand(low, x, y, wall.yaw)
        elif piece.name == "bathtub" and self.chance(0.8):
            drape = openings.shower_curtain(rng, piece.size[0] * rng.uniform(0.35, 1.0), self.size[2])
            along = 0.0 if self.chance(0.5) else piece.size[0] - drape.size[0]
            start, end, _, front = self.footprints[-1]
            x, y = front + along * (end - start) / piece.size[0] + 0.01 * (front - start) / piece.size[1]
            shape = rectangle(x, y, drape.size[0], drape.size[1], wall.yaw)
            if not any(overlap(shape, other) for other in self.footprints):
                drape = drape if self.swap is None else self.swap(drape)
                self.parts += moved(drape.parts, (x, y, 0.0), wall.yaw)
                self.footprints.append(shape)

    def chairs_around(self, table: Piece, x: float, y: float, yaw: float) -> None:
        """Chairs of one make at the sides of a table, facing it, some a little turned."""
        rng = self.rng
        if table.name == "coffee table":
            return
        seat = furniture.chair(rng)
        width, depth, _ = table.size
        sides = [
            (width * (i + 0.5) / n, end, turn)
            for n in (max(1, int(width / 0.7)),)
            for i in range(n)
            for end, turn in ((depth, np.pi), (0.0, 0.0))
        ]
        sides += [(0.0, depth / 2, -np.pi / 2), (width, depth / 2, np.pi / 2)]
        for along, across, turn in sides:
            if self.chance(0.25):
                continue
            own = turn + rng.uniform(-0.12, 0.12)
            gap = rng.uniform(0.06, 0.3)
            out = np.array([np.sin(turn), -np.cos(turn)])
            back = np.array([along, across]) + out * (seat.size[1] + gap)
            corner = back - np.array([np.cos(own), np.sin(own)]) * seat.size[0] / 2
            cosine, sine = np.cos(yaw), np.sin(yaw)
            self.stand(
                seat, x + cosine * corner[0] - sine * corner[1], y + sine * corner[0] + cosine * corner[1], yaw + own
            )

    def rug(self) -> None:
        """A flat rug (ignored) somewhere, under whatever stands there."""
        rng = self.rng
        width, depth = rng.uniform(1.0, 2.4), rng.uniform(0.8, 1.8)
        x, y = (
            (side / 2 - 0.3 - reach / 2) * rng.uniform(-1, 1)
            for side, reach in zip(self.size[:2], (width, depth), strict=True)
        )
        self.parts.append(
            block(IGNORE, m.rug(rng), (x - width / 2, y - depth / 2, 0), (x + width / 2, y + depth / 2, 0.008))
        )

    def curtains(self) -> None:
        """Drapes at the sides of windows, or over them."""
        rng, height = self.rng, self.size[2]
        for wall, left, right, low, high in self.draped:
            cloth_seed = int(rng.integers(1 << 30))
            bottom = rng.uniform(0.02, 0.1) if self.chance(0.6) else max(0.02, low - 0.15)
            top = min(high + 0.12, height - 0.03)
            share = rng.uniform(0.15, 0.5)
            span = (right - left) * share + 0.2
            for start in (left - 0.2, right + 0.2 - span):
                start = min(max(start, 0.02), wall.length - span - 0.02)
                x, y = wall.at(start)
                shape = rectangle(x, y, span, 0.18, wall.yaw)
                if bottom < 1.2 and any(overlap(shape, other) for other in (*self.footprints, *self.kept_free)):
                    continue
                drape = openings.curtain(np.random.default_rng(cloth_seed), span, bottom, top)
                self.hang(wall, drape, start, 0.0)
                self.footprints.append(shape)

    def pictures(self) -> None:
        """Pictures at eye height where a wall is free."""
        rng = self.rng
        for _ in range(int(rng.integers(1, 9))):
            piece = openings.picture(rng)
            wall = self.walls[int(rng.integers(4))]
            slack = wall.length - piece.size[0] - 0.3
            low = max(1.5 + rng.uniform(-0.15, 0.25) - piece.size[2] / 2, 0.5)
            if slack < 0 or low + piece.size[2] > self.size[2] - 0.1:
                continue
            left = 0.15 + slack * rng.random()
            if wall.free(left - 0.05, left + piece.size[0] + 0.05, low - 0.05, low + piece.size[2] + 0.05):
                self.hang(wall, piece, left, low)

    def clutter(self) -> None:
        """Small things on tables and cabinets, and some on the floor."""
        rng = self.rng
        for x, y, yaw, width, depth, height in self.surfaces:
            taken: list[tuple[float, float, float]] = []
            for _ in range(int(rng.integers(0, 6))):
                size = rng.uniform(0.08, 0.32)
                thing = openings.clutter(rng, size)
                reach = max(thing.size[0], thing.size[1])
                if reach > min(width, depth) - 0.06:
                    continue
                a, b = rng.uniform(0.03, width - reach - 0.03), rng.uniform(0.03, depth - reach - 0.03)
                if any(abs(a - c) < reach + r and abs(b - d) < reach + r for c, d, r in taken):
                    continue
                taken.append((a, b, reach))
                thing = thing if self.swap is None else self.swap(thing)
                cosine, sine = np.cos(yaw), np.sin(yaw)
                self.parts += moved(thing.parts, (x + cosine * a - sine * b, y + sine * a + cosine * b, height), yaw)
        for _ in range(int(rng.integers(1, 8))):
            thing = openings.clutter(rng, rng.uniform(0.15, 0.6))
            yaw = rng.uniform(-np.pi, np.pi)
            x, y = (rng.uniform(-0.5, 0.5) * (side - 0.4) for side in self.size[:2])
            self.stand(thing, x, y, yaw)
