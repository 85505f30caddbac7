"""The paper's ablation: training settings of its five variants, and the table of their reports."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import pairwise
from statistics import mean

from semgs.evaluation.scoring.intervals import Interval, paired_differences
from semgs.evaluation.tables.evaluation_report import SavedReport
from semgs.evaluation.tables.table_grid import Cell, Grid
from semgs.objectives.measures import TITLES
from semgs.training.training_settings import TrainingSettings

METRICS = ("miou", "miou_per_image", "accuracy", "class_accuracy")
"""The columns of the paper's table; mIoU in both kinds."""


@dataclass(frozen=True)
class AblationRow:
    """A variant in the paper's table: the parts of the variant above it, and one more.

    Attributes:
        name: of its folder.
        title: the part that it adds, as in the paper.
        shared_layers, windows, camera_aware: parts of its network.
        smoothness: whether its loss has the smoothness term.
    """

    name: str
    title: str
    shared_layers: bool = True
    windows: bool = True
    camera_aware: bool = True
    smoothness: bool = True

    @property
    def parts(self) -> tuple[bool, ...]:
        """The four parts in the order of the paper's columns."""
        return self.shared_layers, self.windows, self.camera_aware, self.smoothness


ROWS = (
    AblationRow("none", "none", shared_layers=False, windows=False, camera_aware=False, smoothness=False),
    AblationRow("shared", "+ Sh-Layer", windows=False, camera_aware=False, smoothness=False),
    AblationRow("windows", "+ Sw-Trans", camera_aware=False, smoothness=False),
    AblationRow("camera", "+ C-Inj", smoothness=False),
    AblationRow("full", "+ Sm-Loss"),
)
"""From none of the parts to the full method, in the paper's order."""


def row_settings(settings: TrainingSettings, row: AblationRow, seed: int) -> TrainingSettings:
    """The settings of a variant: those of the full method with only the variant's parts, and this seed.

    Raises:
        ValueError: the full method itself lacks a part, so two variants would be equal.
    """
    full = settings.network
    lacks = [
        title
        for title, there in {
            "Sh-Layer": full.shared_layers,
            "Sw-Trans": full.windows > 1,
            "C-Inj": full.camera_aware_colour and full.camera_aware_semantic,
            "Sm-Loss": settings.losses.smoothness > 0,
        }.items()
        if not there
    ]
    if lacks:
        raise ValueError(f"the full method lacks {', '.join(lacks)}; an ablation starts from all four parts")
    network = replace(
        full,
        shared_layers=row.shared_layers,
        windows=full.windows if row.windows else 1,
        camera_aware_colour=row.camera_aware,
        camera_aware_semantic=row.camera_aware,
    )
    losses = settings.losses if row.smoothness else replace(settings.losses, smoothness=0.0)
    return replace(settings, network=network, losses=losses, seed=seed)


def ablation_grid(reports: Mapping[tuple[str, int], SavedReport], views: int) -> Grid:
    """The paper's table: which parts each variant has, then the metrics with their 95 % intervals.

    Args:
        reports: by variant's name and seed; unfinished variants may be missing.
        views: the number of contexts to show.

    With several seeds, a cell is their mean and half their range.
    """
    rows, over = [], "scenes"
    for row in ROWS:
        done = [report.results[views] for (name, _), report in sorted(reports.items()) if name == row.name]
        if not done:
            continue
        over = str(done[0].numbers["intervals_over"])
        parts = [Cell("✓" if there else "–") for there in row.parts]
        scores = [Cell(_score([result.numbers for result in done], metric)) for metric in METRICS]
        rows.append((Cell(row.title), *parts, *scores))
    targets = len(next(iter(reports.values())).results[views].frames) if reports else 0
    seeds = sorted({seed for _, seed in reports})
    notes = [f"In brackets: the 95 % interval over {over}."]
    if len(seeds) > 1:
        notes.append(f"Means over {len(seeds)} seeds, ± half the difference between the highest and the lowest.")
    return Grid(
        title=f"Ablation, {views} input views, {targets} targets, seed{'s' if len(seeds) > 1 else ''} {', '.join(map(str, seeds))}",
        head=("row", "Sh-Layer", "Sw-Trans", "C-Inj", "Sm-Loss", *[TITLES[metric] for metric in METRICS]),
        rows=tuple(rows),
        notes=tuple(notes),
    )


def steps_grid(reports: Mapping[tuple[str, int], SavedReport], views: int) -> Grid:
    """What each part adds: its variant minus the one above, for each seed, with paired 95 % intervals.

    Args:
        reports: as for `ablation_grid`.
        views: the number of contexts to show.
    """
    rows = []
    for before, after in pairwise(ROWS):
        for seed in sorted({seed for _, seed in reports}):
            if (before.name, seed) not in reports or (after.name, seed) not in reports:
                continue
            first, second = (reports[one.name, seed].results[views] for one in (before, after))
            differences = paired_differences(first.frames, second.frames)
            cells = [_difference_cell(differences.get(metric)) for metric in METRICS]
            rows.append((Cell(after.title), Cell(str(seed)), *cells))
    return Grid(
        title="What each part adds",
        head=("part", "seed", *[TITLES[metric] for metric in METRICS]),
        rows=tuple(rows),
        mark=" *",
        notes=("* the interval excludes 0. Intervals are over targets; training again would vary by more.",),
    )


def _difference_cell(difference: Interval | None) -> Cell:
    """A difference with its interval."""
    if difference is None:
        return Cell("–")
    ends = f"({difference.low:+.3f} to {difference.high:+.3f})"
    return Cell(f"{difference.value:+.3f} {ends}", marked=difference.excludes_zero)


def _score(done: Sequence[Mapping], metric: str) -> str:
    """A metric of a variant: value and interval, or for several seeds mean and half range."""
    values = [one[metric] for one in done if one[metric] is not None]
    if not values:
        return "–"
    if len(values) > 1:
        return f"{mean(values):.3f} ± {(max(values) - min(values)) / 2:.3f}"
    low, high = done[0]["intervals"].get(metric, (None, None))
    return f"{values[0]:.3f}" + ("" if low is None or high is None else f" ({low:.3f}–{high:.3f})")
