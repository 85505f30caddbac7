"""The label maps of a ScanNet scan, extracted or in the downloaded zip file, and the meaning of their ids."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from semgs.data.layouts.parts.usable_frames import numbered_files
from semgs.data.layouts.scannet.scannet_labels import FILE_NAME, find_table, labels_of_ids, read_table
from semgs.data.maps import IdMap, MapSource
from semgs.data.tables.nyu40 import NAMES
from semgs.files.archives import members
from semgs.files.errors import InputError
from semgs.files.images.pictures import read_numbers
from semgs.files.paths import not_hidden
from semgs.files.stored import Stored

FILTERED, UNFILTERED, UNZIPPED = "label-filt", "label", "*_2d-label-filt"


@dataclass(frozen=True)
class ScanLabels:
    """The label maps by frame number, or why there are none."""

    maps: Mapping[int, MapSource]
    notes: tuple[str, ...] = ()
    unread: InputError | None = None


def has_labels(folder: Path) -> bool:
    """Whether a folder contains label maps, extracted or not."""
    return (folder / FILTERED).is_dir() or bool(not_hidden(folder.glob(f"{UNZIPPED}*")))


def read_scan_labels(folder: Path, as_gsnerf: bool) -> ScanLabels:
    """The label maps of a scan.

    Raises:
        InputError: the zip file or a map cannot be read.
    """
    maps, where = _label_maps(folder)
    if not maps:
        sentence = f"There are no labels ({FILTERED}/ or SCAN{UNZIPPED[1:]}.zip): only colour and depth are read."
        return ScanLabels({}, (sentence,))
    first = maps[min(maps)]
    if read_numbers(first).dtype == np.uint8:
        if where == FILTERED:
            advice = f"if they are NYU40's, name the folder {UNFILTERED}"
            raise InputError(first, "16-bit ids, as ScanNet has them", "8 bits", advice=advice)
        # scannet_frames_25k
        labels = labels_of_ids({number: number for number in range(len(NAMES) + 1)}, as_gsnerf)
        return ScanLabels(_meant(maps, labels), ("The 8-bit labels are NYU40's, as in scannet_frames_25k.",))
    table = find_table(folder)
    if table is None:
        sentence = f"{FILE_NAME} is neither with the scan nor above it, so the labels cannot be read."
        return ScanLabels({}, (sentence,))
    try:
        return ScanLabels(_meant(maps, read_table(table).labels(as_gsnerf)))
    except InputError as error:
        return ScanLabels({}, unread=error)


def _meant(maps: Mapping[int, Stored], labels: np.ndarray) -> dict[int, MapSource]:
    """Label maps by frame number, given the label of each id."""
    return {number: IdMap(path, labels) for number, path in maps.items()}


def _label_maps(folder: Path) -> tuple[dict[int, Stored], str]:
    """The label maps by frame number, and their kind. Extracted maps are preferred to those in a zip file."""
    for place in (folder, *not_hidden(folder.glob(UNZIPPED))):
        if found := numbered_files(place / FILTERED, endings=(".png",)):
            return dict(found), FILTERED
    archives = not_hidden(folder.glob(f"{UNZIPPED}.zip"))
    if archives:
        inside = {
            int(Path(name).stem): member
            for name, member in members(archives[0]).items()
            if name.lower().endswith(".png") and Path(name).stem.isdecimal()
        }
        return dict(sorted(inside.items())), FILTERED
    return dict(numbered_files(folder / UNFILTERED, endings=(".png",))), UNFILTERED
