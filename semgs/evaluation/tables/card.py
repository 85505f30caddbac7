"""The tables of a model card, from reports; and reports reduced to what such tables need, small enough to keep beside the card."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from semgs.evaluation.tables.compare import MARKED, ROWS
from semgs.evaluation.tables.grid import Cell, Grid, printed
from semgs.evaluation.tables.report import SavedReport, SavedResult, read_report
from semgs.evaluation.tables.texts import TITLES, shown_number, with_interval
from semgs.weights.scores import Figure, Score

METRICS = ("miou", "miou_per_image", "accuracy", "psnr", "depth_abs_rel")
"""The columns."""

BEGIN, END = "<!-- tables of docs/scores -->", "<!-- end of tables -->"
"""Lines of the card between which the tables stand."""


def reduced(content: Mapping[str, Any], title: str) -> dict[str, Any]:
    """A report without what it tells of single targets.

    Args:
        content: of a `report.json`, as `semgs.evaluation.tables.report.report_numbers` made it.
        title: what its data are called, in place of their path.

    Returns:
        What `semgs.evaluation.tables.report.read_report` reads, with no frames.
    """
    frames = [{"scene": one["scene"], "size": one["size"], "samples": []} for one in content["frames"]["scenes"]]
    return {
        **content,
        "data": {**content["data"], "path": title},
        "results": [{**entry, "per_frame": []} for entry in content["results"]],
        "frames": {**content["frames"], "scenes": frames},
    }


def tables(folder: Path) -> str:
    """The tables of all reports in a folder, in Markdown.

    Raises:
        InputError: a report cannot be read.
    """
    grids = card_grids([read_report(path) for path in sorted(folder.glob("*.json"))])
    return "\n\n".join(printed(grid, "markdown") for grid in grids)


def card_grids(reports: Sequence[SavedReport]) -> list[Grid]:
    """The scores of reports of any data with their intervals, each above the oracle that copies the nearest input view; then the classes."""
    pairs = [(report, result) for report in reports for result in report.results.values()]
    rows: list[tuple[Cell, ...]] = []
    for report, result in pairs:
        name = f"{report.data_name} ({len(report.sizes)}), {result.views} views"
        rows.append(_row(name, result.numbers, result.numbers["below_copy"]))
        rows.append(_row(f"  {ROWS['copy']}", result.trivial.get("copy", {}), ()))
    protocols = " and ".join(dict.fromkeys(report.protocol for report in reports))
    marked = any(cell.marked for row in rows for cell in row)
    scores = Grid(
        title=f"Scores, protocol {protocols}",
        groups=(),
        head=("data (scenes), input views", *[TITLES[metric] for metric in METRICS]),
        rows=tuple(rows),
        notes=(
            "In brackets: 95 % intervals over scenes. The oracle copies the nearest input view, with its true classes and depth.",
            *([MARKED] if marked else []),
        ),
    )
    labelled = [(report, result) for report, result in pairs if result.numbers["per_class"]]
    return [scores, *([_classes(labelled)] if labelled else [])]


def scores_of(report: SavedReport) -> tuple[Score, ...]:
    """What a report says of weights, as their header has it.

    Raises:
        ValueError: it is not of weights.
    """
    if report.sha256 is None:
        raise ValueError(f"{report.path} is a report of predictions; expected one of weights")
    return tuple(
        Score(
            data=report.data_name,
            protocol=report.protocol,
            views=views,
            targets=int(result.numbers["samples"]),
            sha256=report.sha256,
            figures=_figures(result.numbers),
        )
        for views, result in report.results.items()
    )


def with_tables(page: str, tables: str) -> str:
    """A page of Markdown with these tables between the marks `BEGIN` and `END`; as `between`."""
    return between(page, tables, BEGIN, END)


def between(page: str, text: str, first: str, last: str) -> str:
    """A page with a text between two lines that mark its place, in place of what was there.

    Raises:
        ValueError: the page has not one of each mark, in order.
    """
    before, begin, rest = page.partition(first)
    _, end, after = rest.partition(last)
    if not begin or not end or first in rest or last in after:
        raise ValueError(f"expected {first} and, below it, {last}, once each")
    return f"{before}{first}\n\n{text}\n\n{last}{after}"


def _row(name: str, numbers: Mapping[str, Any], worse: Sequence[str]) -> tuple[Cell, ...]:
    """A row of the scores."""
    figures = _figures(numbers)
    return (
        Cell(name),
        *[
            Cell(with_interval(metric, one.value, one.low, one.high), marked=metric in worse)
            if (one := figures.get(metric))
            else Cell("–")
            for metric in METRICS
        ],
    )


def _figures(numbers: Mapping[str, Any]) -> dict[str, Figure]:
    """The metrics that an entry has, with their intervals."""
    return {
        metric: Figure(numbers[metric], *numbers["intervals"].get(metric, (None, None)))
        for metric in METRICS
        if numbers.get(metric) is not None
    }


def _classes(pairs: Sequence[tuple[SavedReport, SavedResult]]) -> Grid:
    """IoU of each class, and its share of the true pixels."""
    names = list(dict.fromkeys(one["name"] for _, result in pairs for one in result.numbers["per_class"]))
    held = [{one["name"]: one for one in result.numbers["per_class"]} for _, result in pairs]
    rows = []
    for name in names:
        cells = [Cell(name)]
        for classes in held:
            one, total = classes.get(name), sum(each["pixels"] for each in classes.values())
            share = "–" if one is None or not total else f"{100 * one['pixels'] / total:.1f} %"
            cells += [Cell(share), Cell(shown_number("miou", one["iou"] if one else None))]
        rows.append(tuple(cells))
    return Grid(
        title="Classes",
        groups=tuple((f"{report.data_name}, {result.views} views", 2) for report, result in pairs),
        head=("class", *["pixels", "IoU"] * len(pairs)),
        rows=tuple(rows),
    )
