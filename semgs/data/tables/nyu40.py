"""The 40 classes of NYUv2, through which ScanNet's labels are mapped to the 20 of its benchmark.

The other 20 (ceiling, books, television, lamp, otherprop, ...) are ignored and count in no metric. So is 0, which ScanNet writes for
unlabelled pixels.
"""

from __future__ import annotations

import numpy as np
from jaxtyping import UInt8

from semgs.data.tables.classes import IGNORE, LSM8, SCANNET20

NAMES = (
    "wall", "floor", "cabinet", "bed", "chair", "sofa", "table", "door", "window", "bookshelf", "picture", "counter", "blinds",
    "desk", "shelves", "curtain", "dresser", "pillow", "mirror", "floor mat", "clothes", "ceiling", "books", "refrigerator",
    "television", "paper", "towel", "shower curtain", "box", "whiteboard", "person", "night stand", "toilet", "sink", "lamp",
    "bathtub", "bag", "otherstructure", "otherfurniture", "otherprop",
)  # fmt: skip
"""The name of class n is at n - 1. ScanNet's files also spell the 24th "refridgerator"."""

OTHERPROP = len(NAMES)
"""The id of what has no class of its own."""

GSNERF_OTHER = 6
"""The label that GSNeRF's code gives to otherfurniture: table."""
GSNERF_VOID = 19
"""The label that it gives to unlabelled pixels: a class that it trains and scores."""


def scannet20_labels(as_gsnerf: bool = False) -> UInt8[np.ndarray, " 41"]:
    """The label of each NYU40 id, 0..40, in the table `scannet20`; 255 = none.

    Args:
        as_gsnerf: follow GSNeRF's released code instead of the benchmark and S-Ray: otherfurniture is table, and unlabelled pixels are
            class 19 (`utils/scannet_utils.py`, in the loop after its mapping, which was meant for Replica).
    """
    labels = np.full(len(NAMES) + 1, IGNORE, np.uint8)
    labels[list(SCANNET20.raw_ids)] = np.arange(len(SCANNET20), dtype=np.uint8)
    if as_gsnerf:
        labels[labels == SCANNET20.index("otherfurniture")] = GSNERF_OTHER
        labels[labels == IGNORE] = GSNERF_VOID
    return labels


def lsm8_labels() -> UInt8[np.ndarray, " 41"]:
    """The label of each NYU40 id, 0..40, in the table `lsm8`; all that it does not name is "other", 0 has none."""
    labels = np.full(len(NAMES) + 1, LSM8.index("other"), np.uint8)
    labels[list(LSM8.raw_ids)] = np.arange(len(LSM8), dtype=np.uint8)
    labels[0] = IGNORE
    return labels
