"""Readings that are ours by default and that peers do otherwise: named, so that their numbers can be met on their own terms."""

from __future__ import annotations

from collections.abc import Collection
from pathlib import Path

from semgs.files.errors import InputError

ROWS_972 = "rows-972"
GSNERF_LABELS = "gsnerf-labels"
TOOLBOX_UNDISTORTION = "toolbox-undistortion"
ROW_229 = "row-229.5"

READINGS = {
    ROWS_972: "ScanNet's cameras scaled as S-Ray and GSNeRF do: as if its pictures of 968 rows had 972",
    GSNERF_LABELS: "ScanNet's labels as GSNeRF's released code has them: otherfurniture is table, no label is class 19",
    TOOLBOX_UNDISTORTION: "ScanNet++'s fisheye undone as its toolbox does: without the half pixel between COLMAP and OpenCV",
    ROW_229: "Replica's principal point at row 229.5 of 480, as S-Ray and GSNeRF have it: 10 above where it was rendered",
}
"""What may be asked for, and what it does."""


def check_readings(names: Collection[str]) -> None:
    """See that all names are known.

    Raises:
        ValueError: one is not; the known ones are listed.
    """
    for name in names:
        if name not in READINGS:
            raise ValueError(f"unknown reading {name!r}; known: {', '.join(READINGS)}")


def check_applicable(path: Path, layout: str, names: Collection[str], applicable: Collection[str]) -> None:
    """See that a layout has all the readings that are asked for.

    Raises:
        InputError: it has no such choice.
    """
    for name in names:
        if name not in applicable:
            raise InputError(path, f"a scene that {name} is about ({READINGS[name]})", layout)
