"""The tables of an ablation, from the reports of its variants: their scores, what each part adds, and where it adds it."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from statistics import mean

from paper.ablate.ablation_rows import ROWS, AblationRow
from paper.ablate.fragments import with_fragments
from paper.ablate.view_relations import ViewRelation, thirds
from semgs.evaluation.scoring.frame_scores import FrameScores
from semgs.evaluation.scoring.intervals import (
    Interval,
    Trainings,
    choose_units,
    intervals,
    seed_differences,
    units_in_words,
)
from semgs.evaluation.tables.saved_report import SavedReport
from semgs.evaluation.tables.table_grid import Cell, Grid
from semgs.objectives.measures import TITLES

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
    chains = _chains(rows, reports, views)
    shown = [
        (Cell(row.title), *[_difference_cell(differences.get(metric)) for metric in METRICS])
        for chain in chains
        for row, differences in chain.differences()
    ]
    most = max((len(chain.trainings[0]) for chain in chains), default=0)
    over = units_in_words(choose_units(chain.trainings[0][0]) for chain in chains)
    return Grid(
        title="What each part adds",
        head=("part", *map(_title, METRICS)),
        rows=tuple(shown),
        mark=" *",
        notes=(_EXCLUDES, f"Intervals are over {over}{_OVER_SEEDS if most > 1 else _OF_ONE_SEED}"),
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
    for chain in _chains(rows, reports, views):
        found = [chain.only(part).differences() for _, part in bins]
        for number, row in enumerate(chain.rows[1:]):
            for metric in ("miou", "accuracy"):
                cells = [_difference_cell(differences[number][1].get(metric)) for differences in found]
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
_OF_ONE_SEED = "; training again would vary by more."
_OVER_SEEDS = (
    ", and over seeds. How much seeds differ is estimated from all rows of the paper together, and from its own two rows"
    " for every other."
)


@dataclass(frozen=True)
class _Chain:
    """Variants each of which adds to the one before it, with their scores for the seeds that all of them have.

    Attributes:
        rows: the variants.
        trainings: their scores [row seed target].
    """

    rows: Sequence[AblationRow]
    trainings: Sequence[Trainings]

    def differences(self) -> list[tuple[AblationRow, dict[str, Interval]]]:
        """What each variant but the first adds."""
        return list(zip(self.rows[1:], seed_differences(self.trainings), strict=True))

    def only(self, positions: Sequence[int]) -> _Chain:
        """The scores of some targets."""
        chosen = [[[frames[position] for position in positions] for frames in row] for row in self.trainings]
        return replace(self, trainings=chosen)


def _chains(rows: Sequence[AblationRow], reports: Reports, views: int) -> list[_Chain]:
    """What can be compared: the paper's rows, and each other variant with the row that it adds to; as far as they are there."""
    present = {row.name: row for row in rows if any(name == row.name for name, _ in reports)}
    chains: list[list[AblationRow]] = []
    for row in present.values():
        if row in ROWS and chains and chains[-1][-1].name == row.above:
            chains[-1].append(row)
        else:
            chains.append([present[row.above], row] if row.above in present else [row])
    found = []
    for chain in chains:
        seeds = sorted({seed for _, seed in reports if all((row.name, seed) in reports for row in chain)})
        if len(chain) > 1 and seeds:
            found.append(_Chain(chain, [[_scores(reports[row.name, seed], views) for seed in seeds] for row in chain]))
    return found


def _scores(report: SavedReport, views: int) -> list[FrameScores]:
    """What the tables show of a report."""
    return [_of_classes(frame) for frame in report.results[views].frames]


def _of_classes(frame: FrameScores) -> FrameScores:
    """The scores of a target that the tables show, and no others, which would take their time."""
    return FrameScores(
        frame.scene,
        frame.target,
        frame.contexts,
        confusion=frame.confusion,
        truth=frame.truth,
        fragments=frame.fragments,
    )


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
