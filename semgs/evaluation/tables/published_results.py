"""The paper's tables as printed, to compare with ours. They were not measured here.

Sheng Ye et al., SemGS, ICRA 2026: "ScanNet" (Table 1), "ScanNet++" (Table 2) and the ablation on ScanNet (Table 3).
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Literal

Name = Literal["scannet", "scannetpp", "ablation"]

MARK = "‡"
"""Marks rows that are published and were not run here."""

_COLUMNS = ("miou_per_image", "accuracy_per_image", "class_accuracy_per_image", "fps_encoding_each")

_UNKNOWN = (
    "The paper names neither its ten test scenes, nor its frames and input views, nor its kind of mIoU. We assume mIoU per image, as in the "
    "code of S-Ray and GSNeRF, which it follows. Its FPS were measured on other hardware."
)


@dataclass(frozen=True)
class PublishedRow:
    """A row of a table.

    Attributes:
        name: of the method.
        numbers: by number of input views, then by the names in `semgs.evaluation.scoring.summary.METRICS`.
    """

    name: str
    numbers: Mapping[int, Mapping[str, float]]


@dataclass(frozen=True)
class PublishedTable:
    """A table of the paper.

    Attributes:
        title: of the table.
        rows: as printed, the paper's own method last.
        notes: what the paper does not state, a sentence each.
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
            "The released code of S-Ray reads sensor depth of the input views; that of GSNeRF counts unlabelled pixels as a class.",
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
            "The code of S-Ray and GSNeRF does not read ScanNet++, and ScanNet++ has no mapping to the 20 classes, so the camera, the frames "
            "and the mapping that the paper used are unknown.",
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
            "The paper does not state the number of views; its last row equals that of four views in Table 1.",
            _UNKNOWN,
        ),
    ),
}  # fmt: skip
"""The tables by their names on the command line."""
