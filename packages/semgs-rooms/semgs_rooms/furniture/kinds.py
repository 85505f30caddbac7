"""The kinds of furniture, how Infinigen generates each, and which sizes are realistic."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import asdict, dataclass
from functools import lru_cache
from typing import Literal

import numpy as np

Triple = tuple[float, float, float]
Random = np.random.Generator

OBJECTS = "src/infinigen/assets/objects"
"""Where Infinigen's factories are in its repository."""


@dataclass(frozen=True)
class Make:
    """One object of an Infinigen factory, as `program.py` takes it.

    Attributes:
        factory: its path below `infinigen.assets.objects`.
        seed: of the factory.
        setting: name of a function of `program.py` that configures the factory, empty for none.
        size: arguments of that function [m].
        triangles: approximate number to keep.
        flatten: objects whose flat faces are merged.
        weld: whether to merge corners that nearly coincide.
        picture: side of the image of base colours [px], 0 for none.
        simplify: number of triangles to keep per material, 0 for all.
    """

    factory: str
    seed: int
    setting: str = ""
    size: tuple[float, ...] = ()
    triangles: int = 7000
    flatten: Literal["all", "first", "none"] = "none"
    weld: bool = True
    picture: int = 512
    simplify: int = 0


@dataclass(frozen=True)
class Kind:
    """A kind of furniture.

    Attributes:
        label: its ScanNet-20 class, or "clutter".
        subtype: finer kind, as in a catalogue.
        strict: the class in ScanNet's own table.
        mount: "floor" or "wall".
        share: number of pieces of this kind in a round.
        makes: random choice of the objects to generate.
        low, high: minimum and maximum width, depth and height [m]. Other pieces are scaled to be within them.
        drawn: scale to a random size between them, because Infinigen's own sizes are unrealistic.
        turned: Infinigen's front is +x and is rotated to -y.
        stretch: maximum ratio between the scales of two axes; beyond that, the piece is excluded.
        largest: maximum side before scaling [m]; larger pieces are broken.
        hull: minimum share of the bounding box that the convex hull fills.
        gap: parts farther than this from all others are detached [m].
        core: minimum share of each side that most of the surface must span, to detect stray triangles.
    """

    label: str
    subtype: str
    strict: str
    share: int
    makes: Callable[[Random], tuple[Make, ...]]
    low: Triple
    high: Triple
    mount: Literal["floor", "wall"] = "floor"
    drawn: bool = False
    turned: bool = True
    stretch: float = 1.5
    largest: float = 3.2
    hull: float = 0.3
    gap: float = 0.03
    core: float = 0.55


@dataclass(frozen=True)
class PieceJob:
    """One piece to generate.

    Attributes:
        name: of the piece and of its files.
        kind: key of KINDS.
        number: of the piece.
        seed: of the pieces.
        makes: the objects to generate.
    """

    name: str
    kind: str
    number: int
    seed: int
    makes: tuple[Make, ...]

    def as_json(self) -> dict:
        """The job as `program.py` reads it."""
        return {"name": self.name, "makes": [asdict(make) for make in self.makes]}

    def random(self) -> Random:
        """Random generator for finishing the piece: colours, sizes, books."""
        return np.random.default_rng((self.seed, self.number, 1))


def make_job(seed: int, number: int) -> PieceJob:
    """Piece `number` of a seed, independent of all other pieces.

    Kinds come in rounds: each occurs as often as its share, evenly spread.
    """
    length = sum(kind.share for kind in KINDS.values())
    kind = _round(seed, number // length)[number % length]
    makes = KINDS[kind].makes(np.random.default_rng((seed, number, 0)))
    return PieceJob(f"bake_{kind}_{seed}_{number}", kind, number, seed, makes)


@lru_cache
def _round(seed: int, number: int) -> tuple[str, ...]:
    """The kinds of one round, in order."""
    rng = np.random.default_rng((seed, number, 2))
    names = [(name, kind.share, k) for name, kind in KINDS.items() for k in range(kind.share)]
    return tuple(name for _, name in sorted(((k + rng.random()) / share, name) for name, share, k in names))


def _seed(rng: Random) -> int:
    return int(rng.integers(1, 2**31 - 1))


def _centimetres(rng: Random, *ranges: tuple[float, float]) -> tuple[float, ...]:
    """A random number from each range, in whole centimetres [m]."""
    return tuple(round(float(rng.uniform(low, high)), 2) for low, high in ranges)


def _plain(*factories: str, **settings: object) -> Callable[[Random], tuple[Make, ...]]:
    """One object of one of some factories, not configured."""

    def makes(rng: Random) -> tuple[Make, ...]:
        factory = factories[int(rng.integers(len(factories)))]
        return (Make(factory, _seed(rng), **settings),)  # type: ignore[arg-type]

    return makes


def _set(factory: str, setting: str, ranges: Sequence[tuple[float, float]], **settings: object) -> Callable:
    """One object of a factory, of a random size within ranges [m]."""

    def makes(rng: Random) -> tuple[Make, ...]:
        return (Make(factory, _seed(rng), setting, _centimetres(rng, *ranges), **settings),)  # type: ignore[arg-type]

    return makes


def _bed(rng: Random) -> tuple[Make, ...]:
    width = (0.95, 1.1) if rng.random() < 0.3 else (1.4, 1.85)
    return (Make("seating.bed.BedFactory", _seed(rng), "bed", _centimetres(rng, width), 9000, flatten="first"),)


def _desk(rng: Random) -> tuple[Make, ...]:
    desk = Make("shelves.simple_desk.SimpleDeskFactory", _seed(rng), triangles=4000)
    if rng.random() < 1 / 3:
        return (desk,)
    size = _centimetres(rng, (0.45, 0.55), (0.38, 0.45), (0.58, 0.66))
    cabinet = "shelves.kitchen_cabinet.KitchenCabinetFactory"
    return desk, Make(cabinet, _seed(rng), "drawers", size, 2500, flatten="all", picture=256)


def _curtain(rng: Random) -> tuple[Make, ...]:
    size = _centimetres(rng, (1.2, 2.8), (1.4, 2.5))
    gap = (float(rng.uniform(0.01, 0.25)), float(rng.uniform(0.01, 0.25)), round(float(rng.uniform(0.08, 0.16)), 3))
    reduced: dict = {"triangles": 120000, "flatten": "all", "picture": 0, "simplify": 3600}
    return (Make("windows.window.WindowFactory", _seed(rng), "curtain", (*size, *gap), **reduced),)


SOFA = "seating.sofa.SofaFactory"
KITCHEN = "shelves.kitchen_space"
KINDS: dict[str, Kind] = {
    "bed": Kind("bed", "bed", "bed", 3, _bed, (0.95, 1.98, 0.75), (1.95, 2.2, 1.25)),
    "sofa": Kind("sofa", "sofa", "sofa", 3,
        _set(SOFA, "sofa", ((0.86, 1.0), (1.5, 2.4), (0.8, 0.95)), triangles=9000, weld=False),
        (1.45, 0.8, 0.72), (2.5, 1.15, 1.0)),
    "armchair": Kind("chair", "armchair", "chair", 2,
        _set(SOFA, "sofa", ((0.8, 0.98), (0.8, 1.0), (0.78, 0.92)), triangles=9000, weld=False),
        (0.75, 0.75, 0.72), (1.1, 1.1, 1.0)),
    "chair": Kind("chair", "chair", "chair", 3, _plain("seating.chairs.chair.ChairFactory", triangles=5000),
        (0.42, 0.42, 0.82), (0.6, 0.6, 1.02)),
    "officechair": Kind("chair", "office_chair", "chair", 1,
        _plain("seating.chairs.office_chair.OfficeChairFactory", triangles=6000),
        (0.55, 0.55, 0.85), (0.68, 0.7, 1.0), hull=0.25),
    "table": Kind("table", "dining_table", "table", 2, _plain("tables.dining_table.TableDiningFactory", triangles=5000),
        (0.8, 0.65, 0.72), (2.4, 1.2, 0.77)),
    "coffeetable": Kind("table", "coffee_table", "table", 1,
        _plain("tables.dining_table.CoffeeTableFactory", triangles=5000),
        (0.7, 0.4, 0.33), (1.4, 0.9, 0.5)),
    "sidetable": Kind("table", "side_table", "table", 1,
        _plain("tables.dining_table.SideTableFactory", "shelves.simple_desk.SidetableDeskFactory", triangles=4000),
        (0.35, 0.35, 0.42), (0.65, 0.65, 0.68)),
    "desk": Kind("desk", "desk", "desk", 3, _desk, (1.0, 0.55, 0.71), (1.8, 0.8, 0.77)),
    "bookshelf": Kind("bookshelf", "shelf", "ignore", 4,
        _plain("shelves.simple_bookcase.SimpleBookcaseFactory", "shelves.large_shelf.LargeShelfFactory",
               "shelves.cell_shelf.CellShelfFactory", triangles=4000),
        (0.7, 0.26, 0.75), (1.9, 0.38, 2.1)),
    "wardrobe": Kind("cabinet", "wardrobe", "otherfurniture", 1,
        _plain("shelves.single_cabinet.SingleCabinetFactory", triangles=7000, flatten="all"),
        (0.85, 0.52, 1.8), (1.3, 0.62, 2.1), drawn=True, stretch=4.0),
    "cabinet": Kind("cabinet", "cabinet", "cabinet", 2,
        _plain("shelves.single_cabinet.SingleCabinetFactory", triangles=7000, flatten="all"),
        (0.7, 0.38, 0.9), (0.95, 0.45, 1.3), drawn=True, stretch=4.0),
    "tvstand": Kind("cabinet", "tv_stand", "otherfurniture", 1,
        _plain("shelves.cell_shelf.TVStandFactory", triangles=4000),
        (0.8, 0.3, 0.35), (2.1, 0.5, 0.6)),
    "refrigerator": Kind("refrigerator", "refrigerator", "refrigerator", 2,
        _plain("appliances.beverage_fridge.BeverageFridgeFactory", triangles=8000, weld=False),
        (0.56, 0.62, 1.55), (0.75, 0.72, 1.88), drawn=True, stretch=4.0),
    "stove": Kind("otherfurniture", "stove", "ignore", 1,
        _plain("appliances.oven.OvenFactory", setting="electric", triangles=8000, weld=False),
        (0.58, 0.58, 0.86), (0.62, 0.66, 0.94), drawn=True, stretch=2.5),
    "toilet": Kind("toilet", "toilet", "toilet", 2, _plain("bathroom.toilet.ToiletFactory", triangles=6000, picture=0),
        (0.36, 0.62, 0.7), (0.44, 0.74, 1.0)),
    "bathtub": Kind("bathtub", "bathtub", "bathtub", 2,
        _plain("bathroom.bathtub.BathtubFactory", triangles=5000, picture=0),
        (1.5, 0.7, 0.45), (1.8, 0.95, 0.65)),
    "washbasin": Kind("sink", "sink", "sink", 2,
        _plain("bathroom.bathroom_sink.StandingSinkFactory", triangles=5000, picture=0),
        (0.48, 0.4, 0.85), (0.7, 0.55, 1.05), hull=0.2),
    "door": Kind("door", "door", "door", 3, _plain("elements.doors.DoorFactory", triangles=6000),
        (0.78, 0.05, 1.98), (0.98, 0.16, 2.1), mount="wall", turned=False, stretch=3.0, hull=0.2, core=0.2),
    "window": Kind("window", "window", "window", 2,
        _set("windows.window.WindowFactory", "window", ((0.7, 2.4), (0.9, 2.1)), triangles=3500, flatten="all"),
        (0.7, 0.05, 0.9), (2.6, 0.12, 2.2), mount="wall", turned=False),
    "curtain": Kind("curtain", "curtain", "curtain", 3, _curtain,
        (1.2, 0.06, 1.35), (2.9, 0.2, 2.55), mount="wall", turned=False),
    "kitchen": Kind("counter", "kitchen_base_cabinet", "cabinet", 2,
        _set(f"{KITCHEN}.KitchenSpaceFactory", "kitchen", ((0.6, 0.66), (1.5, 2.6), (2.2, 2.4)),
             triangles=12000, flatten="all"),
        (1.2, 0.58, 0.86), (2.7, 0.68, 0.94), hull=0.25, gap=1.0),
    "island": Kind("counter", "kitchen_base_cabinet", "cabinet", 1,
        _set(f"{KITCHEN}.KitchenIslandFactory", "island", ((0.65, 1.0), (1.1, 2.0)), triangles=9000, flatten="all"),
        (1.0, 0.6, 0.88), (2.2, 1.1, 0.95)),
}  # fmt: skip
"""By the word in the names of their pieces. Chests of drawers, vanities and shower curtains are not generated: those that Infinigen
made for the collection are held out for testing (`semgs_rooms.assets.splits`), so nothing may be trained on similar ones."""
