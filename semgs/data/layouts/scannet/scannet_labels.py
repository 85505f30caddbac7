"""ScanNet's labels: `scannetv2-labels.combined.tsv` maps the ids and names of its annotations to the 40 classes of NYUv2.

Through these, ScanNet's labels are mapped to the 20 of its benchmark. The other 20 (ceiling, books, television, lamp, otherprop, ...) are ignored and count in no metric. So is 0, which ScanNet writes for
unlabelled pixels.
"""

from __future__ import annotations

from collections.abc import Collection, Mapping
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from jaxtyping import UInt8

from semgs.data.confined import may_read
from semgs.data.paper_variants import GSNERF_LABELS, LSM8_LABELS
from semgs.data.tables.classes import IGNORE, LSM8, SCANNET20
from semgs.files.contents import read_text
from semgs.files.errors import InputError

FILE_NAME = "scannetv2-labels.combined.tsv"
LEVELS = 4
"""The file is searched in the scan's folder and this many folders above."""

ID, NAME, NYU40 = "id", "raw_category", "nyu40id"

MOST_IDS = 1 << 16
"""Label maps have 16 bits."""

NYU40_NAMES = (
    "wall", "floor", "cabinet", "bed", "chair", "sofa", "table", "door", "window", "bookshelf", "picture", "counter", "blinds",
    "desk", "shelves", "curtain", "dresser", "pillow", "mirror", "floor mat", "clothes", "ceiling", "books", "refrigerator",
    "television", "paper", "towel", "shower curtain", "box", "whiteboard", "person", "night stand", "toilet", "sink", "lamp",
    "bathtub", "bag", "otherstructure", "otherfurniture", "otherprop",
)  # fmt: skip
"""The name of class n is at n - 1. ScanNet's files also spell the 24th "refridgerator"."""

OTHERPROP = len(NYU40_NAMES)
"""The id of what has no class of its own."""

GSNERF_OTHER = 6
"""The label that GSNeRF's code gives to otherfurniture: table."""
GSNERF_VOID = 19
"""The label that it gives to unlabelled pixels: a class that it trains and scores."""


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
        by_id[identity] = _whole(path, number, NYU40, nyu40 or "0", range(len(NYU40_NAMES) + 1))  # 0: unknown
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


def scannet20_labels(as_gsnerf: bool = False) -> UInt8[np.ndarray, " 41"]:
    """The label of each NYU40 id, 0..40, in the table `scannet20`; 255 = none.

    Args:
        as_gsnerf: follow GSNeRF's released code instead of the benchmark and S-Ray: otherfurniture is table, and unlabelled pixels are
            class 19 (`utils/scannet_utils.py`, in the loop after its mapping, which was meant for Replica).
    """
    labels = np.full(len(NYU40_NAMES) + 1, IGNORE, np.uint8)
    labels[list(SCANNET20.raw_ids)] = np.arange(len(SCANNET20), dtype=np.uint8)
    if as_gsnerf:
        labels[labels == SCANNET20.index("otherfurniture")] = GSNERF_OTHER
        labels[labels == IGNORE] = GSNERF_VOID
    return labels


def lsm8_labels() -> UInt8[np.ndarray, " 41"]:
    """The label of each NYU40 id, 0..40, in the table `lsm8`; all that it does not name is "other", 0 has none."""
    labels = np.full(len(NYU40_NAMES) + 1, LSM8.index("other"), np.uint8)
    labels[list(LSM8.raw_ids)] = np.arange(len(LSM8), dtype=np.uint8)
    labels[0] = IGNORE
    return labels
