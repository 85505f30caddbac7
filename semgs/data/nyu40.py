"""The 40 classes of NYUv2, through which ScanNet's labels become the 20 of its benchmark.

Of the 40, 20 are scored; the rest (ceiling, books, television, lamp, otherprop, ...) are labels of nothing and count in no metric, as
does 0, which ScanNet writes where nobody labelled.
"""

from __future__ import annotations

import numpy as np
from jaxtyping import UInt8

from semgs.data.classes import IGNORE, SCANNET20

NAMES = (
    "wall", "floor", "cabinet", "bed", "chair", "sofa", "table", "door", "window", "bookshelf", "picture", "counter", "blinds",
    "desk", "shelves", "curtain", "dresser", "pillow", "mirror", "floor mat", "clothes", "ceiling", "books", "refrigerator",
    "television", "paper", "towel", "shower curtain", "box", "whiteboard", "person", "night stand", "toilet", "sink", "lamp",
    "bathtub", "bag", "otherstructure", "otherfurniture", "otherprop",
)  # fmt: skip
"""Name of class n at n - 1; ScanNet's files spell the 24th "refridgerator" too."""

GSNERF_OTHER = 6
"""What GSNeRF's released code makes of otherfurniture: table."""
GSNERF_VOID = 19
"""What it makes of all that has no label: a class that it trains and scores."""


def scannet20_labels(as_gsnerf: bool = False) -> UInt8[np.ndarray, 41]:
    """The label of each NYU40 id, 0..40, in the table `scannet20`; 255 = none.

    Args:
        as_gsnerf: as GSNeRF's released code has it, in place of the benchmark's and S-Ray's rule: otherfurniture is table, and
            whatever has no label is class 19 (`utils/scannet_utils.py`, the loop behind its mapping, which was meant for Replica).
    """
    labels = np.full(len(NAMES) + 1, IGNORE, np.uint8)
    labels[list(SCANNET20.raw_ids)] = np.arange(len(SCANNET20), dtype=np.uint8)
    if as_gsnerf:
        labels[labels == SCANNET20.index("otherfurniture")] = GSNERF_OTHER
        labels[labels == IGNORE] = GSNERF_VOID
    return labels
