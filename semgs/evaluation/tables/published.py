"""The paper's tables as they are printed: numbers of others, to stand beside ours and never to be taken for measured here.

Sheng Ye et al., SemGS, ICRA 2026: "ScanNet" (Table 1), "ScanNet++" (Table 2) and the ablation on ScanNet (Table 3).
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Literal

Name = Literal["scannet", "scannetpp", "ablation"]

MARK = "‡"
"""Stands behind the names of rows that are published and were not run here."""

_COLUMNS = ("miou_per_image", "accuracy_per_image", "class_accuracy_per_image", "fps_encoding_each")

_UNKNOWN = (
    "The paper names neither its ten test scenes, nor the frames and their sources, nor which mIoU it means: that theirs is of each image is "
    "inferred from the peers' code, which it follows. Its FPS are of other hardware."
)


@dataclass(frozen=True)
class PublishedRow:
    """A row of a table.

    Attributes:
        name: of the method.
        numbers: by number of input views, by the names of `semgs.evaluation.scoring.summary.METRICS`; what is not printed is absent.
    """

    name: str
    numbers: Mapping[int, Mapping[str, float]]


@dataclass(frozen=True)
class PublishedTable:
    """A table of the paper.

    Attributes:
        title: what it is.
        rows: as they are printed, the paper's own method last.
        notes: what nobody can know who reads it, a sentence each.
    """

    title: str
    rows: tuple[PublishedRow, ...]
    notes: tuple[str, ...]


def _row(name: str, *groups: tuple[float, ...], views: tuple[int, ...] = (2, 3, 4)) -> PublishedRow:
    """A row of numbers for each number of views."""
    return PublishedRow(
        name,
        {count: dict(zip(_COLUMNS, group, strict=False)) for count, group in zip(views, groups, strict=True)},
    )


PUBLISHED: Mapping[Name, PublishedTable] = {
    "scannet": PublishedTable(
        "the paper's Table 1, ScanNet, 10 scenes",
        (
            _row("S-Ray", (0.538, 0.772, 0.619, 0.52), (0.563, 0.778, 0.632, 0.41), (0.604, 0.802, 0.673, 0.34)),
            _row("GSNeRF", (0.529, 0.751, 0.616, 0.25), (0.550, 0.752, 0.648, 0.23), (0.587, 0.796, 0.671, 0.19)),
            _row("SemGS", (0.754, 0.912, 0.803, 8.49), (0.757, 0.908, 0.811, 7.35), (0.765, 0.919, 0.815, 6.10)),
        ),
        (
            _UNKNOWN,
            "The peers' code: S-Ray as released reads the sensor's depth of its input views; GSNeRF's counts pixels without a label as a class.",
        ),
    ),
    "scannetpp": PublishedTable(
        "the paper's Table 2, ScanNet++, 10 scenes",
        (
            _row("S-Ray", (0.411, 0.775, 0.502, 0.60), (0.441, 0.808, 0.523, 0.46), (0.467, 0.804, 0.558, 0.38)),
            _row("GSNeRF", (0.421, 0.760, 0.503, 0.29), (0.450, 0.794, 0.538, 0.26), (0.479, 0.813, 0.562, 0.21)),
            _row("SemGS", (0.625, 0.903, 0.689, 9.24), (0.671, 0.924, 0.734, 7.68), (0.676, 0.927, 0.739, 6.29)),
        ),
        (
            _UNKNOWN,
            "No code of the peers reads ScanNet++, and ScanNet++ has no table to the 20 classes: which camera, which frames and which table "
            "the paper took is not known.",
        ),
    ),
    "ablation": PublishedTable(
        "the paper's Table 3, ablation on ScanNet",
        (
            _row("none", (0.681, 0.856, 0.751), views=(4,)),
            _row("+ Sh-Layer", (0.718, 0.873, 0.776), views=(4,)),
            _row("+ Sw-Trans", (0.744, 0.898, 0.795), views=(4,)),
            _row("+ C-Inj", (0.761, 0.910, 0.812), views=(4,)),
            _row("+ Sm-Loss", (0.765, 0.919, 0.815), views=(4,)),
        ),
        (
            "The paper does not say from how many views; its last row is that of four views in Table 1.",
            _UNKNOWN,
        ),
    ),
}  # fmt: skip
"""The tables by the names that the command line knows."""
