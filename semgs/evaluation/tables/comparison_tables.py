"""Tables that compare reports: in the paper's layout, or as differences with paired intervals."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from types import MappingProxyType
from typing import Any

from semgs._version import __version__
from semgs.evaluation.scoring.intervals import paired_differences, units_in_words
from semgs.evaluation.scoring.summary import LOWER_IS_BETTER, MERGED_METRICS, SEEN_METRICS, THINGS_METRICS
from semgs.evaluation.tables.evaluation_report import COMPARED, worse_than_copy
from semgs.evaluation.tables.published_results import MARK, PublishedTable
from semgs.evaluation.tables.saved_report import SavedReport, SavedResult
from semgs.evaluation.tables.table_grid import Cell, Grid, interval_cells, score_cells
from semgs.files.errors import InputError
from semgs.files.text import counted
from semgs.model.weights.index import read_index
from semgs.objectives.measures import MOSTLY_SEEN, TITLES, shown_number

PAPER = ("miou_per_image", "accuracy_per_image", "class_accuracy_per_image", "fps_encoding_each")
"""The columns of the paper's tables. All but the last are means over images, as in the code of S-Ray and GSNeRF."""

BRIEF = (
    "miou", "miou_merged", "miou_per_image", "accuracy", "accuracy_merged", "class_accuracy", "psnr", "psnr_seen", "ssim", "depth_abs_rel", "depth_abs_rel_seen", "changed_classes", "changed_depth", "unseen",
    "fps_encoding_each",
)  # fmt: skip
"""The metrics that fit in a terminal."""

POOLED = ("miou", *MERGED_METRICS, "accuracy", "psnr", "depth_abs_rel")
"""The columns beside those of the paper."""

SINGLE = ("miou", *MERGED_METRICS, "miou_per_image", "accuracy", "class_accuracy", "aurc", "ece")
"""The columns of a table of single images."""

DATA = ("miou", *MERGED_METRICS, *PAPER[:3], "psnr", "fps_encoding_each")
"""The columns of a table of several data sets."""

HASH = 8
"""So many letters of the SHA-256 of weights tell them apart in tables."""

ROWS = {
    "one_pass": "before refining",
    "copy": "oracle: nearest input view's true labels",
    "warp": "warped with true depth",
    "majority": "most frequent class",
}
"""The names of the baselines in tables."""

MARKED = "† worse than the oracle that copies the nearest input view."


def check_comparable(reports: Sequence[SavedReport]) -> None:
    """Refuse reports that were not made with the same targets.

    Raises:
        InputError: two reports differ in class table, or, for the same number of views, in targets, contexts, size or truth;
            or a report contains totals only, so this cannot be checked; or only one of them is of single images.
    """
    first: dict[int, SavedReport] = {}
    for report in reports:
        if report.single != reports[0].single:
            kinds = [
                f"a report of {'single images' if single else 'rendered views'}"
                for single in (not report.single, report.single)
            ]
            raise InputError(report.path, f"{kinds[0]}, as {reports[0].path}", kinds[1])
        for views, result in report.results.items():
            if not result.frames:
                advice = "--layout data and card can show it"
                raise InputError(report.path, "a complete report", "one with totals only", advice=advice)
            other = first.setdefault(views, report)
            difference = _difference(other, report, other.results[views], result)
            if difference:
                raise InputError(
                    report.path,
                    f"the same targets as {other.path}, for {views} views",
                    difference,
                    advice="evaluate both with one list of frames: --protocol pinned FILE",
                )


def _difference(one: SavedReport, other: SavedReport, first: SavedResult, second: SavedResult) -> str | None:
    """Why two results cannot be compared; None if they can."""
    if one.classes != other.classes:
        return f"class table {other.classes} instead of {one.classes}"
    if len(first.frames) != len(second.frames):
        return f"{len(second.frames)} targets instead of {len(first.frames)}"
    for mine, theirs in zip(first.frames, second.frames, strict=True):
        if (mine.scene, mine.target) != (theirs.scene, theirs.target):
            return f"target {theirs.scene}/{theirs.target} instead of {mine.scene}/{mine.target}"
        if mine.contexts != theirs.contexts:
            return f"contexts {', '.join(theirs.contexts)} of {mine.scene}/{mine.target} instead of {', '.join(mine.contexts)}"
        if one.sizes.get(mine.scene) != other.sizes.get(mine.scene):
            return f"size {other.sizes.get(mine.scene)} of {mine.scene} instead of {one.sizes.get(mine.scene)}"
    return None if first.truth == second.truth else "other true labels or depths"


def paper_grid(reports: Sequence[SavedReport], published: PublishedTable | None = None) -> Grid:
    """The reports in the columns of the paper's tables, with the baselines below; the best of each column is bold.

    Args:
        reports: of the same targets.
        published: a table of the paper. Its rows come first, are marked, and do not count for the best.
    """
    names = distinct_names(reports)
    views = sorted({count for report in reports for count in report.results})
    trivial = _trivial(reports)
    rows = []
    for name, report in zip(names, reports, strict=True):
        numbers = {count: result.numbers for count, result in report.results.items()}
        rows.append(_paper_row(name, numbers, views, trivial.get("copy", {})))
    above = () if published is None else published.rows
    above_rows = [_paper_row(f"{row.name} {MARK}", row.numbers, views) for row in above]
    below_rows = [_paper_row(ROWS[name], numbers, views) for name, numbers in trivial.items()]
    targets = max(len(result.frames) for report in reports for result in report.results.values())
    marked = any(cell.marked for row in rows for cell in row)
    return Grid(
        title=f"{targets} targets, protocol {reports[0].protocol}" + (f"; with {published.title}" if published else ""),
        groups=tuple((f"{count} input views", len(PAPER)) for count in views),
        head=("method", *[TITLES[metric] for _ in views for metric in PAPER]),
        rows=(*above_rows, *_best(rows), *below_rows),
        rules=tuple(number for number in (len(above_rows), len(above_rows) + len(rows)) if number),
        notes=(
            "/image: means over images, then over scenes, as S-Ray and GSNeRF compute them. FPS: each target encoded anew.",
            *([_measured_on(reports)] if published else []),
            *([MARKED] if marked else []),
            *([f"{MARK} published, not run here.", *published.notes] if published else []),
        ),
    )


def pooled_grid(reports: Sequence[SavedReport]) -> Grid:
    """What the paper's columns lack: one confusion matrix over all targets, PSNR, and the depth error. Reports as for `paper_grid`."""
    views = sorted({count for report in reports for count in report.results})
    every = [result.numbers for report in reports for result in report.results.values()]
    shown = [metric for metric in POOLED if any(numbers.get(metric) is not None for numbers in every)]
    trivial = _trivial(reports)

    def row(name: str, numbers: Mapping[int, Mapping[str, Any]]) -> tuple[Cell, ...]:
        """A row for all numbers of views."""
        return (Cell(name), *(cell for count in views for cell in score_cells(numbers.get(count, {}), shown)))

    rows = [
        row(name, {count: result.numbers for count, result in report.results.items()})
        for name, report in zip(distinct_names(reports), reports, strict=True)
    ]
    return Grid(
        title="Over all targets together",
        groups=tuple((f"{count} input views", len(shown)) for count in views),
        head=("method", *[TITLES[metric] for _ in views for metric in shown]),
        rows=(*rows, *(row(ROWS[name], numbers) for name, numbers in trivial.items())),
        rules=(len(rows),) if trivial else (),
        notes=(*_groups_of(reports), *_weights_of(reports)),
    )


def single_grid(reports: Sequence[SavedReport]) -> Grid:
    """The classes of single images, with intervals; the reports are of the same images."""
    results = [report.results[1] for report in reports]
    shown = [metric for metric in SINGLE if any(one.numbers.get(metric) is not None for one in results)]
    return Grid(
        title=reports[0].targets(len(results[0].frames)),
        head=("method", *[TITLES[metric] for metric in shown]),
        rows=tuple(
            (Cell(name), *interval_cells(one.numbers, shown))
            for name, one in zip(distinct_names(reports), results, strict=True)
        ),
        notes=(
            f"In brackets: 95 % intervals over {units_in_words(one.numbers['intervals_over'] for one in results)}; images without cameras count as a scene each.",
            *_groups_of(reports),
            *_weights_of(reports),
        ),
    )


def data_grid(reports: Sequence[SavedReport]) -> Grid:
    """Reports of different data, one below the other, each with the oracle that copies the nearest input view."""
    rows: list[tuple[Cell, ...]] = []
    rules: list[int] = []
    shown = [one for one in DATA if one not in MERGED_METRICS or any(report.groups for report in reports)]
    for report in reports:
        rules += [len(rows)] if rows else []
        for views, result in report.results.items():
            where = f"{with_hash(report)} on {report.data_name} {report.amount(views)}"
            rows.append((Cell(where), *score_cells(result.numbers, shown, result.numbers["below_copy"])))
            if not report.single:
                rows.append((Cell(f"  {ROWS['copy']}"), *score_cells(result.baselines.get("copy", {}), shown)))
    return Grid(
        title=f"{len(reports)} evaluation{'s' * (len(reports) > 1)}, protocol {' and '.join(dict.fromkeys(report.protocol for report in reports))}",
        head=("method and data", *[TITLES[metric] for metric in shown]),
        rows=tuple(rows),
        rules=tuple(rules),
        notes=(
            "Rows of different data are not comparable with each other.",
            _measured_on(reports),
            MARKED,
            *_groups_of(reports),
            *_weights_of(reports),
        ),
    )


def difference_grids(reports: Sequence[SavedReport]) -> list[Grid]:
    """Each further report minus the first, for every metric that both have, with paired 95 % intervals.

    Raises:
        ValueError: there are fewer than two reports, or one shares no number of views with the first.
    """
    if len(reports) < 2:
        raise ValueError(f"expected two or more reports, found {len(reports)}")
    names = distinct_names(reports)
    grids = []
    for name, report in zip(names[1:], reports[1:], strict=True):
        shared = [views for views in reports[0].results if views in report.results]
        if not shared:
            raise ValueError(f"{report.path} and {reports[0].path} have no number of views in common")
        rows, over = [], ""
        for views in shared:
            first, second = reports[0].results[views], report.results[views]
            over = str(first.numbers["intervals_over"])
            differences = paired_differences(first.frames, second.frames)
            for metric in COMPARED:
                if first.numbers.get(metric) is None or second.numbers.get(metric) is None:
                    continue
                rows.append(_difference_row(metric, views, first, second, differences))
        narrow = " (fewer than five scenes), so they are too narrow for other scenes" if over == "frames" else ""
        grids.append(
            Grid(
                title=f"{name} minus {names[0]}, {report.targets(len(reports[0].results[shared[0]].frames))}",
                head=("metric", "views", names[0], name, "difference", "95 % interval"),
                rows=tuple(rows),
                mark=" *",
                notes=(f"* the interval excludes 0. Intervals: paired bootstrap over {over}{narrow}.",),
            )
        )
    return grids


def overview_grid(report: SavedReport) -> Grid:
    """The brief metrics of one report and its baselines, by number of views.

    Metrics over the seen pixels are shown only if a relevant share was not seen, as in `semgs reconstruct`.
    """
    seen = all((result.numbers.get("unseen") or 0) <= 1 - MOSTLY_SEEN for result in report.results.values())
    every = [row for result in report.results.values() for row in (result.numbers, *result.baselines.values())]
    wanted = [metric for metric in BRIEF if not (seen and metric in SEEN_METRICS)]
    shown = [metric for metric in wanted if any(row.get(metric) is not None for row in every)]
    if any(result.numbers["not_given"] for result in report.results.values()):
        shown.append("not_given")
    rows = []
    for views, result in report.results.items():
        own = score_cells(result.numbers, shown, result.numbers["below_copy"])
        rows.append((Cell(f"{report.name}, {views} views"), *own))
        rows += [(Cell(f"  {ROWS[name]}"), *score_cells(numbers, shown)) for name, numbers in result.baselines.items()]
    marked = any(cell.marked for row in rows for cell in row)
    samples = next(iter(report.results.values())).numbers["samples"]
    return Grid(
        title=f"{samples} targets, protocol {report.protocol}",
        head=("method", *[TITLES[metric] for metric in shown]),
        rows=tuple(rows),
        notes=(MARKED,) if marked else (),
    )


def with_hash(report: SavedReport) -> str:
    """The name of a report's method, with the beginning of the hash of its weights."""
    return report.name if report.sha256 is None else f"{report.name} {report.sha256[:HASH]}"


ASIDE = (
    "psnr",
    "ssim",
    "psnr_edges",
    "psnr_gradients",
    "depth_abs_rel",
    "depth_edges",
    "unseen",
    "made_up",
    "flyers",
    "miou",
    "accuracy",
)
"""The columns of a table of targets aside."""


def kinds_grid(report: SavedReport) -> Grid | None:
    """The metrics of targets by how far they are aside of the input views; None if none is."""
    rows = [
        (Cell(f"{kind['kind']}, {views} views"), Cell(str(kind["samples"])), *score_cells(kind, ASIDE))
        for views, result in report.results.items()
        for kind in result.numbers.get("kinds", ())
    ]
    if not rows:
        return None
    return Grid(
        title="Aside of the input views",
        head=("off the nearest input view", "targets", *[TITLES[metric] for metric in ASIDE]),
        rows=tuple(rows),
        notes=(
            "Edges: within 6 px of a depth step. Gradients: PSNR of differences between neighbouring pixels. Made up: drawn where no input view looks. Flyers: drawn, "
            "but the true surface is over 1.25 times as far.",
        ),
    )


def things_grid(report: SavedReport) -> Grid | None:
    """The metrics of things and of free space that were requested, with their intervals; None if none was."""
    rows = {views: result.numbers for views, result in report.results.items()}
    shown = [metric for metric in THINGS_METRICS if any(numbers.get(metric) is not None for numbers in rows.values())]
    if not shown:
        return None
    return Grid(
        title="Things and free space",
        head=("", *(f"{report.name}, {views} views" for views in rows)),
        rows=tuple(
            (Cell(TITLES[metric]), *(cell for numbers in rows.values() for cell in interval_cells(numbers, [metric])))
            for metric in shown
        ),
        notes=(
            "Things match in the image above an IoU of one half, boxes in metres. Free space is beside that by measured depth.",
        ),
    )


def distinct_names(reports: Sequence[SavedReport]) -> list[str]:
    """The names of the reports' methods, with the beginning of the hash of weights; equal ones get the folder or, if needed, a number."""
    names = [with_hash(report) for report in reports]
    with_folder = [
        f"{name} ({report.path.absolute().parent.name})" if names.count(name) > 1 else name
        for name, report in zip(names, reports, strict=True)
    ]
    if len(set(with_folder)) == len(names):
        return with_folder
    return [f"{name} #{number}" if names.count(name) > 1 else name for number, name in enumerate(names, 1)]


def _groups_of(reports: Sequence[SavedReport]) -> list[str]:
    """Which groups of classes the merged metrics are of."""
    names = dict.fromkeys(report.groups.name for report in reports if report.groups is not None)
    return [f"Merged: by groups of classes ({', '.join(names)})."] if names else []


def _weights_of(reports: Sequence[SavedReport]) -> list[str]:
    """Which of the weights are the included ones."""
    included = {one.sha256: one.name for one in read_index()}
    hashes = dict.fromkeys(report.sha256 for report in reports if report.sha256 is not None)
    if not hashes:
        return []
    said = [
        f"{one[:HASH]} {f'is {included[one]} of semgs {__version__}' if one in included else 'is not included'}"
        for one in hashes
    ]
    return [f"Weights, by the beginning of their SHA-256: {'; '.join(said)}."]


def _measured_on(reports: Sequence[SavedReport]) -> str:
    """The machines on which FPS were measured."""
    machines = dict.fromkeys(
        f"{one.get('gpu', one.get('processor', 'unknown'))}"
        + (f", {counted(int(one['threads']), 'thread')}" if "threads" in one and "gpu" not in one else "")
        for one in (report.hardware for report in reports)
    )
    return f"FPS of the rows run here: on {'; '.join(machines)}."


def _trivial(reports: Sequence[SavedReport]) -> dict[str, dict[int, Mapping[str, Any]]]:
    """The baselines by name and number of views, from the first report that has them: all reports have the same targets. What a method
    gives before it refines is shown if it is the only one."""
    rows: dict[str, dict[int, Mapping[str, Any]]] = {}
    for name in [name for name in ROWS if name != "one_pass" or len(reports) == 1]:
        for result in (result for report in reports for result in report.results.values()):
            if name in result.baselines:
                rows.setdefault(name, {}).setdefault(result.views, result.baselines[name])
    return rows


def _paper_row(
    name: str,
    numbers: Mapping[int, Mapping[str, Any]],
    views: Sequence[int],
    copy: Mapping[int, Mapping[str, Any]] = MappingProxyType({}),
) -> tuple[Cell, ...]:
    """A row for all numbers of views; metrics that are worse than those of the copy are marked."""
    cells = [Cell(name)]
    for count in views:
        ours = numbers.get(count, {})
        cells += score_cells(ours, PAPER, worse_than_copy(ours, copy.get(count, {})))
    return tuple(cells)


def _best(rows: Sequence[tuple[Cell, ...]]) -> list[tuple[Cell, ...]]:
    """The rows, with the highest number of each column marked as best if there are several rows."""
    if len(rows) < 2:
        return list(rows)

    def number(cell: Cell) -> float:
        return float("-inf") if cell.text == "–" else float(cell.text)

    names, *columns = zip(*rows, strict=True)
    marked = []
    for column in columns:
        highest = max(map(number, column))
        marked.append([replace(cell, best=number(cell) == highest > float("-inf")) for cell in column])
    return list(zip(names, *marked, strict=True))


def _difference_row(
    metric: str, views: int, first: SavedResult, second: SavedResult, differences: Mapping[str, Any]
) -> tuple[Cell, ...]:
    """A metric of two reports, with difference and interval."""
    before, after = first.numbers[metric], second.numbers[metric]
    interval = differences.get(metric)
    low, high = ("", "") if interval is None else (_signed(metric, interval.low), _signed(metric, interval.high))
    ends = f"{low} to {high}" if low else "–"
    # As printed: an interval that begins at +0.0003 is printed from 0.000, and nobody could see why it has a star.
    clear = low[:1] in ("+", "−") and low[:1] == high[:1]
    arrow = " ↓" if metric in LOWER_IS_BETTER else ""
    return (
        Cell(TITLES[metric] + arrow),
        Cell(str(views)),
        Cell(shown_number(metric, before)),
        Cell(shown_number(metric, after)),
        Cell(_signed(metric, after - before), marked=clear),
        Cell(ends),
    )


def _signed(metric: str, value: float) -> str:
    """A difference as text, with sign."""
    text = shown_number(metric, abs(value))
    return text if not set(text) & set("123456789") else ("+" if value > 0 else "−") + text
