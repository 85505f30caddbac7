"""Tables that compare reports: in the paper's layout, or as differences with paired intervals."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import Any, Literal

from semgs.evaluation.scoring.intervals import paired_differences
from semgs.evaluation.scoring.summary import LOWER_IS_BETTER, SEEN_METRICS
from semgs.evaluation.tables.evaluation_report import COMPARED, SavedReport, SavedResult, below
from semgs.evaluation.tables.published_results import MARK, PublishedTable
from semgs.evaluation.tables.table_grid import Cell, Grid
from semgs.files.errors import InputError
from semgs.objectives.measures import MOSTLY_SEEN, TITLES, shown_number

Layout = Literal["paper", "difference", "data", "card"]

PAPER = ("miou_per_image", "accuracy_per_image", "class_accuracy_per_image", "fps_encoding_each")
"""The columns of the paper's tables. All but the last are means over images, as in the code of S-Ray and GSNeRF."""

BRIEF = (
    "miou", "miou_per_image", "accuracy", "class_accuracy", "psnr", "psnr_seen", "ssim", "depth_abs_rel", "depth_abs_rel_seen", "unseen",
    "fps_encoding_each",
)  # fmt: skip
"""The metrics that fit in a terminal."""

FULL = tuple(metric for metric in TITLES if metric != "not_given")

DATA = ("miou", *PAPER[:3], "psnr", "fps_encoding_each")
"""The columns of a table of several data sets."""

ROWS = {
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
            or a report contains totals only, so this cannot be checked.
    """
    first: dict[int, SavedReport] = {}
    for report in reports:
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
    by_views: dict[str, dict[int, Mapping[str, Any]]] = {
        name: {count: result.numbers for count, result in report.results.items()}
        for name, report in zip(names, reports, strict=True)
    }
    trivial = _trivial(reports, views)
    rows = [
        tuple([Cell(name), *_paper_cells(numbers, views, trivial.get("copy", {}))])
        for name, numbers in by_views.items()
    ]
    above = () if published is None else published.rows
    above_rows = [tuple([Cell(f"{row.name} {MARK}"), *_paper_cells(row.numbers, views, {})]) for row in above]
    below_rows = [tuple([Cell(ROWS[name]), *_paper_cells(numbers, views, {})]) for name, numbers in trivial.items()]
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


def data_grid(reports: Sequence[SavedReport]) -> Grid:
    """Reports of different data, one below the other, each with the oracle that copies the nearest input view."""
    rows: list[tuple[Cell, ...]] = []
    rules: list[int] = []
    for report in reports:
        rules += [len(rows)] if rows else []
        for views, result in report.results.items():
            worse = result.numbers["below_copy"]
            scenes = len(report.sizes)
            where = f"{report.name} on {report.data_name} ({scenes} scene{'s' * (scenes > 1)}), {views} views"
            rows.append(_overview_row(where, result.numbers, DATA, worse))
            copy = result.trivial.get("copy", {})
            rows.append(_overview_row(f"  {ROWS['copy']}", copy, DATA, []))
    return Grid(
        title=f"{len(reports)} evaluation{'s' * (len(reports) > 1)}, protocol {' and '.join(dict.fromkeys(report.protocol for report in reports))}",
        groups=(),
        head=("method and data", *[TITLES[metric] for metric in DATA]),
        rows=tuple(rows),
        rules=tuple(rules),
        notes=("Rows of different data are not comparable with each other.", _measured_on(reports), MARKED),
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
        grids.append(
            Grid(
                title=f"{name} minus {names[0]}, {len(reports[0].results[shared[0]].frames)} targets, protocol {report.protocol}",
                groups=(),
                head=("metric", "views", names[0], name, "difference", "95 % interval"),
                rows=tuple(rows),
                mark=" *",
                notes=(
                    f"* the interval excludes 0. Intervals: paired bootstrap over {over}"
                    + (
                        " (fewer than five scenes), so they are too narrow for other scenes."
                        if over == "frames"
                        else "."
                    ),
                ),
            )
        )
    return grids


def overview_grid(report: SavedReport, metrics: Sequence[str] = FULL) -> Grid:
    """The metrics of one report and its baselines, by number of views.

    Metrics over the seen pixels are shown only if a relevant share was not seen, as in `semgs reconstruct`.
    """
    seen = all((result.numbers.get("unseen") or 0) <= 1 - MOSTLY_SEEN for result in report.results.values())
    every = [row for result in report.results.values() for row in (result.numbers, *result.trivial.values())]
    wanted = [metric for metric in metrics if not (seen and metric in SEEN_METRICS)]
    shown = [metric for metric in wanted if any(row.get(metric) is not None for row in every)]
    if any(result.numbers["not_given"] for result in report.results.values()):
        shown.append("not_given")
    rows = []
    for views, result in report.results.items():
        worse = result.numbers["below_copy"]
        rows.append(_overview_row(f"{report.name}, {views} views", result.numbers, shown, worse))
        rows += [_overview_row(f"  {ROWS[name]}", numbers, shown, []) for name, numbers in result.trivial.items()]
    marked = any(cell.marked for row in rows for cell in row)
    samples = next(iter(report.results.values())).numbers["samples"]
    return Grid(
        title=f"{samples} targets, protocol {report.protocol}",
        groups=(),
        head=("method", *[TITLES[metric] for metric in shown]),
        rows=tuple(rows),
        notes=(MARKED,) if marked else (),
    )


def distinct_names(reports: Sequence[SavedReport]) -> list[str]:
    """The reports' names; equal names get the folder or, if needed, a number."""
    names = [report.name for report in reports]
    with_folder = [
        f"{name} ({report.path.absolute().parent.name})" if names.count(name) > 1 else name
        for name, report in zip(names, reports, strict=True)
    ]
    if len(set(with_folder)) == len(names):
        return with_folder
    return [f"{name} #{number}" if names.count(name) > 1 else name for number, name in enumerate(names, 1)]


def _measured_on(reports: Sequence[SavedReport]) -> str:
    """The machines on which FPS were measured."""
    machines = dict.fromkeys(
        f"{one.get('gpu', one.get('processor', 'unknown'))}"
        + (f", {one['threads']} threads" if "threads" in one and "gpu" not in one else "")
        for one in (report.hardware for report in reports)
    )
    return f"FPS of the rows run here: on {'; '.join(machines)}."


def _overview_row(
    name: str, numbers: Mapping[str, Any], shown: Sequence[str], worse: Sequence[str]
) -> tuple[Cell, ...]:
    """A row with some metrics."""
    return (
        Cell(name),
        *[Cell(shown_number(metric, numbers.get(metric)), marked=metric in worse) for metric in shown],
    )


def _trivial(reports: Sequence[SavedReport], views: Sequence[int]) -> dict[str, dict[int, Mapping[str, Any]]]:
    """The baselines by name and number of views, from the first report that has them: all reports have the same targets."""
    found: dict[str, dict[int, Mapping[str, Any]]] = {}
    for name in ROWS:
        for count in views:
            for report in reports:
                result = report.results.get(count)
                if result is not None and name in result.trivial:
                    found.setdefault(name, {}).setdefault(count, result.trivial[name])
    return found


def _paper_cells(
    numbers: Mapping[int, Mapping[str, Any]], views: Sequence[int], copy: Mapping[int, Mapping[str, Any]]
) -> list[Cell]:
    """The cells of a row, for all numbers of views."""
    cells = []
    for count in views:
        ours = numbers.get(count, {})
        worse = below(ours, copy.get(count, {}))
        cells += [Cell(shown_number(metric, ours.get(metric)), marked=metric in worse) for metric in PAPER]
    return cells


def _best(rows: Sequence[tuple[Cell, ...]]) -> list[tuple[Cell, ...]]:
    """The rows, with the highest number of each column marked as best if there are several rows."""
    if len(rows) < 2:
        return list(rows)

    def number(cell: Cell) -> float:
        return float("-inf") if cell.text == "–" else float(cell.text)

    highest = [max(map(number, column)) for column in list(zip(*rows, strict=True))[1:]]
    return [
        (
            row[0],
            *[
                replace(cell, best=number(cell) == top > float("-inf"))
                for cell, top in zip(row[1:], highest, strict=True)
            ],
        )
        for row in rows
    ]


def _difference_row(
    metric: str, views: int, first: SavedResult, second: SavedResult, differences: Mapping[str, Any]
) -> tuple[Cell, ...]:
    """A metric of two reports, with difference and interval."""
    before, after = first.numbers[metric], second.numbers[metric]
    interval = differences.get(metric)
    ends = "–" if interval is None else f"{_signed(metric, interval.low)} to {_signed(metric, interval.high)}"
    clear = interval is not None and (interval.low > 0 or interval.high < 0)
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
    return text if float(text) == 0 else ("+" if value > 0 else "−") + text
