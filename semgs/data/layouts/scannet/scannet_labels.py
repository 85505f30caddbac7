"""`scannetv2-labels.combined.tsv`: maps the ids and names of ScanNet's annotations to NYU40 classes."""

from __future__ import annotations

from collections.abc import Collection, Mapping
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from jaxtyping import UInt8

from semgs.data.confined import may_read
from semgs.data.paper_variants import GSNERF_LABELS, LSM8_LABELS
from semgs.data.tables.nyu40 import NAMES, OTHERPROP, lsm8_labels, scannet20_labels
from semgs.files.contents import read_text
from semgs.files.errors import InputError

FILE_NAME = "scannetv2-labels.combined.tsv"
LEVELS = 4
"""The file is searched in the scan's folder and this many folders above."""

ID, NAME, NYU40 = "id", "raw_category", "nyu40id"

MOST_IDS = 1 << 16
"""Label maps have 16 bits."""


@dataclass(frozen=True)
class LabelTable:
    """The content of the table.

    Attributes:
        path: the file.
        by_id: NYU40 class of each id. Some rows with the same id disagree ("shower door" and "shower doors"); the last one counts, as in
            ScanNet's and S-Ray's scripts.
        by_name: NYU40 class of each raw category.
    """

    path: Path
    by_id: dict[int, int]
    by_name: dict[str, int]

    def labels(self, as_peers: Collection[str] = ()) -> UInt8[np.ndarray, " 65536"]:
        """As `labels_of_ids`."""
        return labels_of_ids(self.by_id, as_peers)


def labels_of_ids(nyu40: Mapping[int, int], as_peers: Collection[str] = ()) -> UInt8[np.ndarray, " 65536"]:
    """The label of every 16-bit id, given their NYU40 classes; other ids are treated as NYU40 id 0, or, in `lsm8`, as "other".

    Args:
        nyu40: the classes.
        as_peers: with `LSM8_LABELS`, labels in the table `lsm8`; otherwise in `scannet20`, perhaps as GSNeRF's (`GSNERF_LABELS`).
    """
    classes = np.zeros(MOST_IDS, np.uint8)
    classes[list(nyu40)] = list(nyu40.values())
    if LSM8_LABELS in as_peers:
        classes[1:][classes[1:] == 0] = OTHERPROP
        return lsm8_labels()[classes]
    return scannet20_labels(GSNERF_LABELS in as_peers)[classes]


def find_table(folder: Path) -> Path | None:
    """The table of a scan: in its folder, or the nearest one above."""
    around = [folder, *folder.absolute().parents][: LEVELS + 1]
    return next((one / FILE_NAME for one in around if may_read(one) and (one / FILE_NAME).is_file()), None)


def read_table(path: Path) -> LabelTable:
    """Read the table.

    Raises:
        InputError: it cannot be read, lacks a column (like ScanNet's first table and those of other data sets), or an id is not an
            integer.
    """
    lines = read_text(path, "a table in UTF-8").splitlines()
    header = lines[0].split("\t") if lines else []
    for column in (ID, NAME, NYU40):
        if column not in header:
            raise InputError(
                path,
                f"ScanNet's {FILE_NAME}, with columns {ID}, {NAME} and {NYU40}",
                "columns " + ", ".join(header)[:60] if header else "an empty file",
                key=column,
                advice="download it with ScanNet's script: --label_map",
            )
    places = [header.index(column) for column in (ID, NAME, NYU40)]
    by_id: dict[int, int] = {}
    by_name: dict[str, int] = {}
    for number, line in enumerate(lines[1:], 2):
        if not line.strip():
            continue
        values = line.split("\t")
        raw_id, name, nyu40 = (values[place].strip() if place < len(values) else "" for place in places)
        identity = _whole(path, number, ID, raw_id, range(1, MOST_IDS))
        by_id[identity] = _whole(path, number, NYU40, nyu40 or "0", range(len(NAMES) + 1))  # 0: unknown
        by_name[normal(name)] = by_id[identity]
    return LabelTable(path, by_id, by_name)


def normal(name: str) -> str:
    """A label's name as in the tables: lower case, single spaces."""
    return " ".join(name.lower().split())


def _whole(path: Path, line: int, column: str, text: str, allowed: range) -> int:
    """An integer of the table, in the allowed range."""
    if not text.isdecimal() or len(text) > 9 or int(text) not in allowed:
        raise InputError(
            path, f"a whole number {allowed[0]}..{allowed[-1]}", f"{text!r:.60}", key=f"line {line}, {column}"
        )
    return int(text)
