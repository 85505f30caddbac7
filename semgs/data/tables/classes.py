"""Class tables: the names, colours and raw ids of the classes."""

from __future__ import annotations

from dataclasses import dataclass

IGNORE = 255
"""The label of unlabelled pixels. They count in no semantic loss or metric."""


@dataclass(frozen=True, repr=False)
class ClassTable:
    """A class table; a label is a position in it.

    Attributes:
        name: how files refer to the table ("scannet20").
        names: the classes in label order.
        colours: their sRGB colours, 0..255, in the same order.
        raw_ids: their ids in the source data set, in the same order (NYU40 ids for ScanNet).

    Raises:
        ValueError: the lists are empty, longer than 255 or differ in length, or a name appears twice.
    """

    name: str
    names: tuple[str, ...]
    colours: tuple[tuple[int, int, int], ...]
    raw_ids: tuple[int, ...]

    def __post_init__(self) -> None:
        if not len(self.names) == len(self.colours) == len(self.raw_ids) or not 0 < len(self.names) <= IGNORE:
            raise ValueError(
                f"class table {self.name} has {len(self.names)} names, {len(self.colours)} colours and {len(self.raw_ids)} ids; "
                f"expected equal numbers between 1 and {IGNORE}"
            )
        if len(set(self.names)) != len(self.names):
            raise ValueError(f"class table {self.name} has a class name twice")

    def __repr__(self) -> str:
        """Without its lists, which would fill the pages of `help` wherever a table is a default."""
        return f"<class table {self.name}, {len(self.names)} classes>"

    def __len__(self) -> int:
        return len(self.names)

    def within(self, coarser: ClassTable) -> tuple[int, ...] | None:
        """The class of a coarser table that each class is: that of its name, or "other"; None if the other table is no such table of ours."""
        if coarser not in TABLES or "other" not in coarser.names:
            return None
        return tuple(coarser.index(name if name in coarser.names else "other") for name in self.names)

    def index(self, name: str) -> int:
        """The label of a class by its name."""
        return self.names.index(name)


SCANNET20 = ClassTable(
    name="scannet20",
    names=(
        "wall", "floor", "cabinet", "bed", "chair", "sofa", "table", "door", "window", "bookshelf", "picture", "counter",
        "desk", "curtain", "refrigerator", "shower curtain", "toilet", "sink", "bathtub", "otherfurniture",
    ),
    colours=(
        (174, 199, 232), (152, 223, 138), (31, 119, 180), (255, 187, 120), (188, 189, 34), (140, 86, 75), (255, 152, 150),
        (214, 39, 40), (197, 176, 213), (148, 103, 189), (196, 156, 148), (23, 190, 207), (247, 182, 210), (219, 219, 141),
        (255, 127, 14), (158, 218, 229), (44, 160, 44), (112, 128, 144), (227, 119, 194), (82, 84, 163),
    ),
    raw_ids=(1, 2, 3, 4, 5, 6, 7, 8, 9, 10, 11, 12, 14, 16, 24, 28, 33, 34, 36, 39),
)  # fmt: skip
"""The 20 classes of the ScanNet benchmark: its order and colours, with NYU40 ids."""

LSM8 = ClassTable(
    name="lsm8",
    names=("wall", "floor", "ceiling", "chair", "table", "sofa", "bed", "other"),
    colours=(
        (174, 199, 232), (152, 223, 138), (78, 71, 183), (188, 189, 34), (255, 152, 150), (140, 86, 75), (255, 187, 120), (82, 84, 163),
    ),
    raw_ids=(1, 2, 22, 5, 7, 6, 4, 40),
)  # fmt: skip
"""The classes that LSM, Uni3R, C3G and EPS3D are compared in (NVlabs/LSM, HorizonRobotics/Uni3R), with NYU40 ids; "other" is all that is labelled else."""

TABLES = (SCANNET20, LSM8)


def class_table(name: str) -> ClassTable:
    """The class table with a name.

    Raises:
        ValueError: there is none; the error lists the known ones.
    """
    for table in TABLES:
        if table.name == name:
            return table
    raise ValueError(f"unknown class table {name!r}; known: {', '.join(table.name for table in TABLES)}")
