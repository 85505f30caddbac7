"""The tables of a model card."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

from semgs.evaluation.scoring.intervals import units_in_words
from semgs.evaluation.tables.comparison_tables import MARKED, ROWS
from semgs.evaluation.tables.saved_report import SavedReport, SavedResult
from semgs.evaluation.tables.table_grid import Cell, Grid, interval_cells
from semgs.figures.plotting import RiskCurve
from semgs.model.weights.header import Figure
from semgs.objectives.measures import TITLES, shown_number

METRICS = ("miou", "miou_per_image", "accuracy", "psnr", "depth_abs_rel")
"""The columns."""

CONFIDENCE = ("aurc", "ece")
"""The columns of the table of confidence, beside those of `KEPT`."""

KEPT = (50, 80, 90, 100)
"""Shares of the pixels, the most confident ones [%]."""


def card_grids(reports: Sequence[SavedReport]) -> list[Grid]:
    """The scores of some reports with intervals, each followed by the oracle that copies the nearest input view; then the classes."""
    pairs = [(report, result) for report in reports for result in report.results.values()]
    rows: list[tuple[Cell, ...]] = []
    for report, result in pairs:
        name = f"{report.data_name} ({len(report.sizes)}), {result.views} views"
        rows.append((Cell(name), *interval_cells(result.numbers, METRICS, result.numbers["below_copy"])))
        rows.append((Cell(f"  {ROWS['copy']}"), *interval_cells(result.baselines.get("copy", {}), METRICS)))
    protocols = " and ".join(dict.fromkeys(report.protocol for report in reports))
    marked = any(cell.marked for row in rows for cell in row)
    over = units_in_words(result.numbers["intervals_over"] for _, result in pairs)
    scores = Grid(
        title=f"Scores, protocol {protocols}",
        head=("data (scenes), input views", *[TITLES[metric] for metric in METRICS]),
        rows=tuple(rows),
        notes=(
            f"In brackets: 95 % intervals over {over}. The oracle copies the nearest input view, with its true classes and depth.",
            *([MARKED] if marked else []),
        ),
    )
    labelled = [(report, result) for report, result in pairs if result.numbers["per_class"]]
    sure = [(report, result) for report, result in pairs if result.numbers.get("risk_coverage")]
    return [scores, *([_classes(labelled)] if labelled else []), *([_confidence(sure)] if sure else [])]


def risk_curve(name: str, numbers: Mapping[str, Any]) -> RiskCurve:
    """The risk-coverage curve of an entry.

    Args:
        name: of the curve.
        numbers: with `risk_coverage`.
    """
    keys = ("coverage", "risk", "low", "high")
    return RiskCurve(name, *(tuple(point[key] for point in numbers["risk_coverage"]) for key in keys))


def figures(numbers: Mapping[str, Any]) -> dict[str, Figure]:
    """The metrics of an entry, with their intervals."""
    return {
        metric: Figure(numbers[metric], *numbers["intervals"].get(metric, (None, None)))
        for metric in METRICS
        if numbers.get(metric) is not None
    }


def _confidence(pairs: Sequence[tuple[SavedReport, SavedResult]]) -> Grid:
    """How far confidence can be trusted."""
    rows = []
    for report, result in pairs:
        points = {round(100 * point["coverage"]): point for point in result.numbers["risk_coverage"]}
        shares = [f"{100 * points[share]['risk']:.1f} % ({points[share]['confidence']:.2f})" for share in KEPT]
        name = Cell(f"{report.data_name} ({len(report.sizes)}), {result.views} views")
        rows.append((name, *interval_cells(result.numbers, CONFIDENCE), *map(Cell, shares)))
    return Grid(
        title="Confidence",
        head=(
            "data (scenes), input views",
            *[TITLES[name] for name in CONFIDENCE],
            *[f"wrong in {share} %" for share in KEPT],
        ),
        rows=tuple(rows),
        notes=(
            "Labelled and seen pixels. AURC: area under the risk-coverage curve. ECE: 15 bins with the same number of pixels. Then: wrong classes among the most "
            "confident pixels, with the least confidence of these in brackets.",
        ),
    )


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
