"""Write the tables of docs/model_card.md from the reports in docs/scores."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any

from paper.release.pages import CARD, RISKS, SCORES, write_between
from semgs.evaluation.scoring.summary import ON_REQUEST
from semgs.evaluation.tables.card import card_grids, risk_curve
from semgs.evaluation.tables.saved_report import read_report
from semgs.evaluation.tables.table_grid import printed
from semgs.figures.plotting import risk_coverage_picture
from semgs.files.atomic import write_bytes, write_json
from semgs.files.images.pictures import png_bytes
from semgs.files.strict_json import read_json

BEGIN, END = "<!-- tables of docs/scores -->", "<!-- end of tables -->"
"""Markers of the tables in the card."""


def reduced(content: Mapping[str, Any], title: str) -> dict[str, Any]:
    """A report without the entries of single targets, and without metrics that were not requested, to keep it small.

    Args:
        content: of a `report.json`, from `semgs.evaluation.tables.evaluation_report.evaluation_numbers`.
        title: name of the data, which replaces its path.

    Returns:
        What `semgs.evaluation.tables.saved_report.read_report` reads, with no frames.
    """
    frames = [{"scene": one["scene"], "size": one["size"], "samples": []} for one in content["frames"]["scenes"]]
    return {
        **content,
        "data": {**content["data"], "path": title},
        "results": [_requested({**entry, "per_frame": []}) for entry in content["results"]],
        "frames": {**content["frames"], "scenes": frames},
    }


def _requested(entry: Any) -> Any:
    """An entry, and what it contains, without the metrics that were not requested."""
    if isinstance(entry, list):
        return [_requested(one) for one in entry]
    if not isinstance(entry, dict):
        return entry
    return {name: _requested(one) for name, one in entry.items() if one is not None or name not in ON_REQUEST}


def tables(folder: Path) -> str:
    """The tables of all reports in a folder, in Markdown.

    Raises:
        InputError: a report cannot be read.
    """
    grids = card_grids([read_report(path) for path in sorted(folder.glob("*.json"))])
    return "\n\n".join(printed(grid, "markdown") for grid in grids)


def risk_picture(folder: Path) -> bytes:
    """The risk-coverage curves of all reports in a folder, as PNG; empty if none has one.

    Raises:
        InputError: a report cannot be read.
    """
    reports = [read_report(path) for path in sorted(folder.glob("*.json"))]
    results = [
        (f"{report.data_name}, {views} views", result.numbers)
        for report in reports
        for views, result in report.results.items()
    ]
    curves = [risk_curve(name, numbers) for name, numbers in results if numbers.get("risk_coverage")]
    return png_bytes(risk_coverage_picture(curves)) if curves else b""


def write_card(reports: Mapping[str, Path]) -> None:
    """Write the tables into the card, and the plot of its risk-coverage curves.

    Args:
        reports: to add to docs/scores first, by title; a report with the same title is replaced. Delete those of older weights by hand.

    Raises:
        InputError: a report cannot be read.
    """
    for title, path in reports.items():
        read_report(path)  # refuses files that are not reports
        SCORES.mkdir(exist_ok=True)
        content = read_json(path, "the report.json of an evaluation")
        assert isinstance(content, dict)
        write_json(SCORES / f"{title.replace(' ', '_')}.json", reduced(content, title))
    write_between(CARD, tables(SCORES), BEGIN, END)
    if picture := risk_picture(SCORES):
        write_bytes(RISKS, picture)
