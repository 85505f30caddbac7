"""Readings: ways in which other papers' code reads files differently, by name, to reproduce their numbers."""

from __future__ import annotations

from collections.abc import Collection
from pathlib import Path

from semgs.files.errors import InputError

ROWS_972 = "rows-972"
GSNERF_LABELS = "gsnerf-labels"
LSM8_LABELS = "lsm8"
TOOLBOX_UNDISTORTION = "toolbox-undistortion"
ROW_229 = "row-229.5"

READINGS = {
    ROWS_972: "ScanNet's cameras scaled as in S-Ray and GSNeRF: as if its images of 968 rows had 972",
    GSNERF_LABELS: "ScanNet's labels as in GSNeRF's released code: otherfurniture is table, no label is class 19",
    LSM8_LABELS: "ScanNet's labels in the eight classes of LSM and Uni3R: wall, floor, ceiling, chair, table, sofa, bed, other",
    TOOLBOX_UNDISTORTION: "ScanNet++'s fisheye undistorted as in its toolbox: without the half pixel between COLMAP and OpenCV",
    ROW_229: "Replica's principal point at row 229.5 of 480, as in S-Ray and GSNeRF: 10 above where it was rendered",
}
"""The readings by name, and what they do."""


def check_readings(names: Collection[str]) -> None:
    """Refuse unknown names.

    Raises:
        ValueError: a name is unknown; the error lists the known ones.
    """
    for name in names:
        if name not in READINGS:
            raise ValueError(f"unknown reading {name!r}; known: {', '.join(READINGS)}")


def check_applicable(path: Path, layout: str, names: Collection[str], applicable: Collection[str]) -> None:
    """Refuse readings that a layout does not have.

    Raises:
        InputError: it lacks one.
    """
    for name in names:
        if name not in applicable:
            raise InputError(path, f"a scene for the reading {name} ({READINGS[name]})", layout)
