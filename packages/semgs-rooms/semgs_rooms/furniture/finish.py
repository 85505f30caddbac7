"""Turn Infinigen's meshes into pieces for rooms: check, colour, split, rotate and scale them."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from semgs_rooms.assets.glb import read_primitives, write_primitives
from semgs_rooms.furniture import surfaces as s
from semgs_rooms.furniture import tints as t
from semgs_rooms.furniture.books import books_on
from semgs_rooms.furniture.cloth import cloth_picture
from semgs_rooms.furniture.kinds import KINDS, OBJECTS, Kind, PieceJob, Random, Triple
from semgs_rooms.furniture.raw import Incomplete, RawMesh, check_complete
from semgs_rooms.furniture.surfaces import Surface
from semgs_rooms.furniture.tints import Colour, Tint

MOST_TRIANGLES = 12_000
"""Maximum for a finished piece."""
ORIGIN = {
    "licence": "BSD-3-Clause (Infinigen; generated output)",
    "source_repo": "princeton-vl/infinigen",
    "author": "Infinigen authors (Princeton Vision & Learning Lab)",
}
NOTE = "generated with Infinigen, base colour baked and retinted"


@dataclass(frozen=True)
class FinishedPiece:
    """A finished piece: metres, z up, base on z = 0, centred in x and y, front = -y.

    Attributes:
        name: of its files.
        kind: its kind.
        surfaces: its triangles.
        source: path of the factory's module in Infinigen's repository.
    """

    name: str
    kind: Kind
    surfaces: tuple[Surface, ...]
    source: str

    def row(self, file: str, size: int, version: str) -> dict:
        """The piece's row of `catalog.json`."""
        labelled = [(number, one) for number, one in enumerate(self.surfaces) if one.label is not None]
        parts = {s.surface_node_name(number, one): one.label for number, one in labelled}
        row = {
            "name": self.name, "class": self.kind.label, "subtype": self.kind.subtype,
            "scannet20_strict": self.kind.strict, "file": file,
            "triangles": sum(len(one.faces) for one in self.surfaces),
            "extents_m": [round(float(side), 3) for side in s.sides(self.surfaces)], "up": "z", "front": "-y",
            "mount": self.kind.mount, "textured": any(one.picture is not None for one in self.surfaces),
            "licence": ORIGIN["licence"], "source_repo": ORIGIN["source_repo"], "commit": version, "path": self.source,
            "bytes": size, "author": ORIGIN["author"], "note": NOTE,
        }  # fmt: skip
        return row | ({"part_classes": parts} if parts else {})

    def write(self, path: Path) -> None:
        """Write the .glb file and check that it can be read."""
        written = s.primitives(self.surfaces)
        write_primitives(path, written)
        assert len(read_primitives(path)) == len(written)


def finish(job: PieceJob, meshes: Sequence[RawMesh]) -> list[FinishedPiece]:
    """The pieces of a job, one for most kinds.

    Raises:
        Incomplete: a piece is broken or has an unrealistic size.
        ImportError: embreex is not installed.
    """
    kind = KINDS[job.kind]
    for number, mesh in enumerate(meshes):
        check_complete(mesh, kind if number == 0 else DRAWERS)
    rng = job.random()
    source = f"{OBJECTS}/{job.makes[0].factory.rsplit('.', 1)[0].replace('.', '/')}.py"
    pieces = []
    for suffix, made, surfaces in MAKERS[job.kind](kind, meshes, rng):
        sized = _sized(surfaces, made, rng)
        count = sum(len(one.faces) for one in sized)
        if count > MOST_TRIANGLES:
            raise Incomplete(f"{count} triangles remain, more than {MOST_TRIANGLES}")
        pieces.append(FinishedPiece(job.name + suffix, made, tuple(sized), source))
    return pieces


DRAWERS = replace(KINDS["cabinet"], low=(0.3, 0.3, 0.4), high=(0.6, 0.7, 0.8))
"""The chest below a desk."""

Made = list[tuple[str, Kind, list[Surface]]]
"""Of each piece of a job: suffix of its name, kind, and surfaces with front = -y."""


def _sized(surfaces: Sequence[Surface], kind: Kind, rng: Random) -> list[Surface]:
    """Scale to the kind's sizes; Incomplete if one axis would be scaled much more than another."""
    sides = s.sides(surfaces)
    low, high = np.array(kind.low), np.array(kind.high)
    factors = (rng.uniform(low, high) if kind.drawn else np.clip(sides, low, high)) / sides
    if factors.max() > kind.stretch * factors.min():
        wide, deep, tall = sides
        raise Incomplete(f"{wide:.2f} x {deep:.2f} x {tall:.2f} m is no size for a {kind.subtype.replace('_', ' ')}")
    return s.scale(surfaces, factors)


def _fronted(surfaces: list[Surface], kind: Kind) -> list[Surface]:
    return s.turn(surfaces) if kind.turned else surfaces


def _coloured(tints: Callable[[Random], list[Tint]], hollow: bool = False) -> Callable[..., Made]:
    """A maker of textured pieces; `hollow` removes what is not visible from outside."""

    def make(kind: Kind, meshes: Sequence[RawMesh], rng: Random) -> Made:
        one = s.surface(meshes[0], "body", picture=t.apply_tints(meshes[0], tints(rng)))
        return [("", kind, _fronted([s.remove_hidden(one) if hollow else one], kind))]

    return make


def _plain(names: Sequence[tuple[str, tuple[str, ...], Sequence[Colour]]]) -> Callable[..., Made]:
    """A maker of untextured pieces. For each surface: name, words in the names of its materials, and colours to choose from."""

    def make(kind: Kind, meshes: Sequence[RawMesh], rng: Random) -> Made:
        mesh, left = meshes[0], np.ones(len(meshes[0].faces), bool)
        surfaces = []
        for name, words, colours in names:
            wanted = left & _of(mesh, words)
            left &= ~wanted
            if wanted.any():
                surfaces.append(s.surface(mesh, name, wanted, colour=t.linear_rgb(t.pick_colour(rng, colours))))
        return [("", kind, _fronted(surfaces, kind))]

    return make


def _of(mesh: RawMesh, words: Sequence[str]) -> np.ndarray:
    """Triangles whose material has one of some words in its name."""
    numbers = [number for number, name in enumerate(mesh.materials) if any(word in name.lower() for word in words)]
    return np.isin(mesh.material, numbers)


# Colours by kind.


def _metal(rng: Random, colours: Sequence[Colour] = t.METALS) -> Tint:
    return Tint(t.METAL, t.pick_colour(rng, colours), 0.4)


def _boards(rng: Random) -> list[Tint]:
    wood = t.pick_colour(rng, t.WOODS)
    return [_metal(rng), Tint(("",), wood, t.grain(wood))]


def _bed(kind: Kind, meshes: Sequence[RawMesh], rng: Random) -> Made:
    mesh, wood = meshes[0], t.pick_colour(rng, (*t.NATURAL, t.PAINTED[0], t.PAINTED[3]))
    keeps_prints = rng.random() < 0.25
    tints = []
    for name in sorted(mesh.materials):
        if any(word in name.lower() for word in t.CLOTH):
            colour = t.pick_colour(rng, t.FABRICS[:4] + t.FABRICS)
            printed = "art" in name.lower()
            own = printed and (keeps_prints or rng.random() < 0.45)
            tints.append(Tint((name.lower(),), None if own else colour, 0.8 if own and keeps_prints else 0.5))
    tints.sort(key=lambda tint: -len(tint.words[0]))
    tints += [_metal(rng), Tint(("",), wood, t.grain(wood, 0.5))]
    return [("", kind, _fronted([s.surface(mesh, "bed", picture=t.apply_tints(mesh, tints))], kind))]


def _seat(rng: Random) -> list[Tint]:
    leather, wood = Tint(("leather",), t.pick_colour(rng, t.LEATHERS), 0.8), Tint(("wood", *t.METAL), (70, 52, 42), 0.6)
    return [leather, wood, Tint(("",), t.pick_colour(rng, t.FABRICS), 0.4)]


def _chair(rng: Random) -> list[Tint]:
    cloth, metal = Tint(t.CLOTH, t.pick_colour(rng, t.FABRICS), 0.5), _metal(rng)
    return [cloth, metal, Tint(("",), t.pick_colour(rng, t.NATURAL + t.PAINTED[:1] + t.PAINTED[3:4]), 0.7)]


OFFICE: tuple[Colour, ...] = (
    (48, 48, 52), (60, 74, 104), (120, 124, 128), (112, 46, 54), (70, 96, 84), (200, 196, 190), (40, 40, 42), (150, 120, 90),
)  # fmt: skip


def _office_chair(rng: Random) -> list[Tint]:
    return [_metal(rng, ((60, 60, 62), (150, 152, 155), (40, 40, 42))), Tint(("",), t.pick_colour(rng, OFFICE), 0.5)]


def _table_tints(rng: Random) -> list[Tint]:
    return [Tint(("glass",), (170, 190, 195), 0.3), Tint(("marble",), t.pick_colour(rng, t.STONES), 0.8), *_boards(rng)]


def _table(kind: Kind, meshes: Sequence[RawMesh], rng: Random) -> Made:
    """A table with its longer side at the front."""
    one = [s.surface(meshes[0], "table", picture=t.apply_tints(meshes[0], _table_tints(rng)))]
    wide, deep, _ = s.sides(one)
    return [("", kind, one if wide >= deep else s.turn(one))]


def _desk(kind: Kind, meshes: Sequence[RawMesh], rng: Random) -> Made:
    """A desk, sometimes with one or two chests of drawers below."""
    wood = t.pick_colour(rng, t.WOODS)
    leg = t.pick_colour(rng, (*t.METALS, (60, 60, 62), (235, 235, 235), wood, wood))
    tints = [Tint(t.METAL, leg, 0.2), Tint(("",), wood, t.grain(wood))]
    desk = _sized(s.turn([s.surface(meshes[0], "desk", picture=t.apply_tints(meshes[0], tints))]), kind, rng)
    if len(meshes) == 1:
        return [("", kind, desk)]
    width, depth, height = s.sides(desk)
    paint = wood if rng.random() < 0.7 else t.PAINTED[0]
    picture = t.apply_tints(meshes[1], [Tint(t.METAL, (170, 172, 175), 0.4), Tint(("",), paint, t.grain(paint))])
    chest = s.turn([s.remove_hidden(s.surface(meshes[1], "drawers", picture=picture))])
    chest = s.scale(chest, np.array([0.4, 0.88 * depth, height - 0.075]) / s.sides(chest))
    places = (-1, 1) if width > 1.5 and rng.random() < 0.4 else (int(rng.choice((-1, 1))),)
    drawers = [s.shift(chest[0], (side * (width / 2 - 0.28), 0, 0)) for side in places]
    office = replace(kind, subtype="office_desk")
    return [("", office, [*desk, *drawers])]


def _bookshelf(kind: Kind, meshes: Sequence[RawMesh], rng: Random) -> Made:
    """A shelf; four of five contain books."""
    picture = t.apply_tints(meshes[0], _boards(rng))
    shelf = _sized(s.turn([s.surface(meshes[0], "shelf", picture=picture)]), kind, rng)
    books = books_on(shelf[0], rng) if rng.random() < 0.8 else None
    if books is None:
        return [("", kind, shelf)]
    return [("", replace(kind, subtype="bookshelf", strict="bookshelf"), [*shelf, books])]


FRIDGES: tuple[Colour, ...] = (
    (236, 236, 234), (178, 181, 184), (228, 228, 226), (60, 62, 64), (190, 192, 194), (240, 240, 238), (150, 154, 158),
    (222, 216, 200), (40, 41, 43), (170, 60, 56),
)  # fmt: skip


def _refrigerator(kind: Kind, meshes: Sequence[RawMesh], rng: Random) -> Made:
    """A refrigerator with one door, with a freezer above, with two doors side by side, or a low one."""
    picture = t.apply_tints(meshes[0], [Tint(("",), t.pick_colour(rng, FRIDGES), 0.35)])
    body = s.turn([s.remove_hidden(s.surface(meshes[0], "refrigerator", picture=picture))])
    width, depth, height = rng.uniform(kind.low, kind.high)
    form = rng.choice(("one", "freezer", "double", "low"), p=(0.35, 0.35, 0.2, 0.1))
    size: Triple = {"double": (0.91, depth, height), "low": (0.55, 0.58, 0.86)}.get(form, (width, depth, height))
    wide, deep, tall = size

    def door(*extents: float) -> Surface:
        return s.scale(body, np.array(extents) / s.sides(body))[0]

    if form == "freezer":
        doors = [door(wide, deep, 0.66 * tall), s.shift(door(wide, deep, 0.335 * tall), (0, 0, 0.665 * tall))]
    elif form == "double":
        half = door(0.497 * wide, deep, tall)
        doors = [s.shift(s.flip(half), (-0.2515 * wide, 0, 0)), s.shift(half, (0.2515 * wide, 0, 0))]
    else:
        doors = [door(*size)]
    one = s.merge(doors)
    if len(one.faces) > MOST_TRIANGLES:
        one = doors[0]
    sides = tuple(s.sides([one]))
    return [("", replace(kind, low=sides, high=sides), [one])]


def _door_tints(rng: Random) -> list[Tint]:
    wood = t.pick_colour(rng, (*t.WOODS, t.PAINTED[0], t.PAINTED[4]))
    return [
        Tint(("glass",), (180, 195, 205), 0.3),
        Tint(t.METAL, t.pick_colour(rng, t.METALS), 0.5),
        Tint(("",), wood, t.grain(wood)),
    ]


def _curtain(kind: Kind, meshes: Sequence[RawMesh], rng: Random) -> Made:
    """Drapes with a texture of ours, and their rod. Infinigen's are upside down."""
    mesh = meshes[0]
    cloth, rod = _of(mesh, ("cloth",)), _of(mesh, ("rod",))
    if not cloth.any():
        raise Incomplete("there is no curtain at the window")
    hanging = s.surface(mesh, "cloth", cloth)
    upright = hanging.vertices * [-1, 1, -1]
    lowest, extent = upright.min(axis=0), np.ptp(upright, axis=0)
    uv = ((upright - lowest) / extent)[:, (0, 2)] * [0.98, -0.98] + [0.01, 0.99]
    drapes = replace(hanging, vertices=upright, uv=uv, picture=cloth_picture(rng, float(extent[0]), float(extent[2])))
    surfaces = [drapes]
    if rod.any():
        colour = t.linear_rgb(t.pick_colour(rng, (*t.METALS, (70, 52, 42), (235, 235, 232))))
        bar = s.surface(mesh, "rod", rod, colour=colour)
        surfaces.append(replace(bar, vertices=bar.vertices * [-1, 1, -1]))
    return [("", kind, surfaces)]


CUPBOARDS: tuple[Colour, ...] = (
    (240, 240, 238), (196, 164, 120), (110, 76, 52), (150, 158, 160), (70, 90, 84), (222, 200, 165), (60, 74, 94), (45, 43, 42),
)  # fmt: skip
WALL_CABINET = Kind(
    "cabinet", "kitchen_wall_cabinet", "cabinet", 0, KINDS["kitchen"].makes, (1.2, 0.3, 0.6), (2.7, 0.42, 0.95), mount="wall",
)  # fmt: skip


def _kitchen(kind: Kind, meshes: Sequence[RawMesh], rng: Random) -> Made:
    """Base cabinets under a counter, and the wall cabinets above if there are any; or an island."""
    mesh = meshes[0]
    paint = t.pick_colour(rng, CUPBOARDS)
    stone = Tint(("marble",), t.pick_colour(rng, t.STONES), 0.8)
    picture = t.apply_tints(
        mesh, [stone, Tint(t.METAL, (170, 172, 175), 0.4), Tint(("",), paint, t.grain(paint, 0.35))]
    )
    heights = mesh.vertices[mesh.faces][..., 2].mean(axis=1)
    levels = np.unique(np.round(heights, 2))
    gap = int(np.diff(levels).argmax())
    hung = levels[gap + 1] - levels[gap] > HANGS
    above = heights > (levels[gap] + levels[gap + 1]) / 2 if hung else np.zeros(len(heights), bool)
    top = _of(mesh, ("marble",)) & ~above
    label = "cabinet" if kind is KINDS["kitchen"] else None  # all of an island is a counter
    body = s.surface(mesh, "body", ~above & ~top, picture=picture, label=label)
    surfaces = [s.remove_hidden(body)]
    if top.any():
        surfaces.append(s.surface(mesh, "worktop", top, picture=picture))
    pieces: Made = [("", kind, s.turn(surfaces))]
    if above.any():
        wall = s.remove_hidden(s.surface(mesh, "cabinet", above, picture=picture))
        pieces.append(("_wall", WALL_CABINET, s.turn([wall])))
    return pieces


HANGS = 0.25
"""Minimum vertical gap between base cabinets and wall cabinets [m]."""

WARE = (("metal", t.METAL, t.METALS), ("ceramic", ("",), t.CERAMICS))
FRAMES = (*t.PAINTED, (150, 106, 70), (60, 60, 62))
_padded, _closed, _ware = _coloured(_seat), _coloured(_boards, hollow=True), _plain(WARE)
MAKERS: dict[str, Callable[[Kind, Sequence[RawMesh], Random], Made]] = {
    "bed": _bed, "sofa": _padded, "armchair": _padded, "chair": _coloured(_chair),
    "officechair": _coloured(_office_chair), "table": _table, "coffeetable": _table, "sidetable": _table, "desk": _desk,
    "bookshelf": _bookshelf, "wardrobe": _closed, "cabinet": _closed, "tvstand": _coloured(_boards),
    "refrigerator": _refrigerator, "stove": _coloured(lambda rng: [], hollow=True),
    "toilet": _ware, "bathtub": _ware, "washbasin": _ware, "door": _coloured(_door_tints),
    "window": _plain((("glass", ("pane",), ((190, 205, 215),)), ("frame", ("",), FRAMES))),
    "curtain": _curtain, "kitchen": _kitchen, "island": _kitchen,
}  # fmt: skip
"""By kind: the function that makes its pieces."""
