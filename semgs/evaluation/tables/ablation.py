"""The tables of an ablation, from the reports of its variants: their scores, what each part adds, and where it adds it."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from statistics import mean

from semgs.evaluation.frames.view_relations import ViewRelation, thirds
from semgs.evaluation.scoring.fragments import with_fragments
from semgs.evaluation.scoring.frame_scores import FrameScores
from semgs.evaluation.scoring.intervals import Interval, Pair, intervals, seed_differences
from semgs.evaluation.tables.evaluation_report import SavedReport
from semgs.evaluation.tables.table_grid import Cell, Grid
from semgs.objectives.measures import TITLES
from semgs.training.ablation_rows import AblationRow

METRICS = ("miou", "miou_per_image", "accuracy", "class_accuracy", "fragments")
"""The columns of the paper's table, mIoU in both kinds, and the share of the class maps that is in tiny regions."""

Reports = Mapping[tuple[str, int], SavedReport]
"""By variant's name and seed; unfinished variants may be missing."""


def read_fragments(report: SavedReport) -> SavedReport:
    """A report with the fragments of the class maps beside it, in the scores of targets and in the numbers.

    Raises:
        InputError: a class map is missing or damaged.
    """
    results = {}
    for views, result in report.results.items():
        frames = tuple(with_fragments(result.frames, report.path.parent))
        found = intervals([replace(_of_classes(frame), confusion=None) for frame in frames]).get("fragments")
        ends = {} if found is None else {"fragments": [found.low, found.high]}
        numbers = dict(result.numbers) | {
            "fragments": mean(frame.fragments or 0.0 for frame in frames),
            "intervals": {**result.numbers["intervals"], **ends},
        }
        results[views] = replace(result, frames=frames, numbers=numbers)
    return replace(report, results=results)


def ablation_grid(rows: Sequence[AblationRow], reports: Reports, views: int) -> Grid:
    """The paper's table: which parts each variant has, then the metrics with their 95 % intervals.

    Args:
        rows: the variants, in order.
        reports: of those that are finished.
        views: the number of contexts to show.

    With several seeds, a cell is their mean and half their range.
    """
    shown, over = [], "scenes"
    for row in rows:
        done = [report.results[views] for (name, _), report in sorted(reports.items()) if name == row.name]
        if not done:
            continue
        over = str(done[0].numbers["intervals_over"])
        parts = [Cell("✓" if there else "–") for there in row.parts]
        scores = [Cell(_score([result.numbers for result in done], metric)) for metric in METRICS]
        shown.append((Cell(row.title), *parts, *scores))
    targets = len(next(iter(reports.values())).results[views].frames) if reports else 0
    seeds = sorted({seed for _, seed in reports})
    notes = [f"In brackets: the 95 % interval over {over}."]
    if len(seeds) > 1:
        notes = [f"Means over {len(seeds)} seeds, ± half the difference between the highest and the lowest."]
    return Grid(
        title=f"Ablation, {views} input views, {targets} targets, seed{'s' if len(seeds) > 1 else ''} {', '.join(map(str, seeds))}",
        head=("row", "Sh-Layer", "Sw-Trans", "C-Inj", "Sm-Loss", *map(_title, METRICS)),
        rows=tuple(shown),
        notes=tuple(notes),
    )


def steps_grid(rows: Sequence[AblationRow], reports: Reports, views: int) -> Grid:
    """What each part adds: its variant minus the one that it adds to, the mean over seeds, with 95 % intervals.

    Args:
        rows, reports, views: as for `ablation_grid`.
    """
    compared = _compared(rows, reports, views)
    shown = [
        (Cell(row.title), *[_difference_cell(differences.get(metric)) for metric in METRICS])
        for row, differences in zip(compared, seed_differences(list(compared.values())), strict=True)
    ]
    most = max(map(len, compared.values()), default=0)
    return Grid(
        title="What each part adds",
        head=("part", *map(_title, METRICS)),
        rows=tuple(shown),
        mark=" *",
        notes=(_EXCLUDES, _OVER_SEEDS if most > 1 else _OVER_TARGETS),
    )


def where_grid(rows: Sequence[AblationRow], reports: Reports, views: int, relations: Sequence[ViewRelation]) -> Grid:
    """Where each part adds what it adds: the targets in thirds, by the overlap of their input views and by the angle between them.

    Args:
        rows, reports, views: as for `ablation_grid`.
        relations: of the input views of each target.
    """
    overlaps, angles = [one.overlap for one in relations], [one.angle for one in relations]
    bins = [(f"overlap {_ends(overlaps, part, '.2f')}", part) for part in thirds(overlaps)]
    bins += [(f"angle {_ends(angles, part, '.0f')}°", part) for part in thirds(angles)]
    shown = []
    compared = _compared(rows, reports, views)
    found = [
        seed_differences([[_only(pair, part) for pair in pairs] for pairs in compared.values()]) for _, part in bins
    ]
    for number, row in enumerate(compared):
        for metric in ("miou", "accuracy"):
            cells = [_difference_cell(differences[number].get(metric)) for differences in found]
            shown.append((Cell(row.title), Cell(_title(metric)), *cells))
    return Grid(
        title="What each part adds, by how the input views lie to one another",
        head=("part", "score", *[name for name, _ in bins]),
        rows=tuple(shown),
        mark=" *",
        notes=(
            _EXCLUDES,
            "Each third of the targets, by the smallest overlap or the largest angle of two of their input views.",
        ),
    )


_EXCLUDES = "* the interval excludes 0."
_OVER_TARGETS = "Intervals are over targets; training again would vary by more."
_OVER_SEEDS = "Intervals are over scenes and seeds; how much seeds differ is estimated from all parts together."


def _compared(rows: Sequence[AblationRow], reports: Reports, views: int) -> dict[AblationRow, list[Pair]]:
    """What is compared for each variant that some seed has together with the one above it."""
    found = {row: _pairs(row, reports, views) for row in rows}
    return {row: pairs for row, pairs in found.items() if pairs}


def _pairs(row: AblationRow, reports: Reports, views: int) -> list[Pair]:
    """The scores of a variant and of the one above it, for every seed that has both."""
    seeds = sorted(seed for name, seed in reports if name == row.name and (row.above, seed) in reports)

    def scores(name: str, seed: int) -> list[FrameScores]:
        return [_of_classes(frame) for frame in reports[name, seed].results[views].frames]

    return [(scores(row.above, seed), scores(row.name, seed)) for seed in seeds]


def _of_classes(frame: FrameScores) -> FrameScores:
    """The scores of a target that the tables show, and no others, which would take their time."""
    return FrameScores(
        frame.scene, frame.target, frame.contexts, frame.confusion, frame.truth, fragments=frame.fragments
    )


def _only(pair: Pair, positions: Sequence[int]) -> Pair:
    """The scores of some targets."""
    first, second = pair
    return [first[position] for position in positions], [second[position] for position in positions]


def _ends(values: Sequence[float], positions: Sequence[int], form: str) -> str:
    """The smallest and the largest of some values."""
    chosen = [values[position] for position in positions]
    return f"{min(chosen):{form}}–{max(chosen):{form}}" if chosen else "–"


def _title(metric: str) -> str:
    return TITLES.get(metric, metric)


def _difference_cell(difference: Interval | None) -> Cell:
    """A difference with its interval."""
    if difference is None:
        return Cell("–")
    ends = f"({difference.low:+.3f} to {difference.high:+.3f})"
    return Cell(f"{difference.value:+.3f} {ends}", marked=difference.excludes_zero)


def _score(done: Sequence[Mapping], metric: str) -> str:
    """A metric of a variant: value and interval, or for several seeds mean and half range."""
    values = [one[metric] for one in done if one.get(metric) is not None]
    if not values:
        return "–"
    if len(values) > 1:
        return f"{mean(values):.3f} ± {(max(values) - min(values)) / 2:.3f}"
    low, high = done[0]["intervals"].get(metric, (None, None))
    return f"{values[0]:.3f}" + ("" if low is None or high is None else f" ({low:.3f}–{high:.3f})")
