"""Metrics as cells of tables, with or without their intervals. No torch."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

from semgs.evaluation.tables.table_grid import Cell
from semgs.objectives.measures import shown_number


def with_interval(metric: str, value: float | None, low: float | None, high: float | None) -> str:
    """A metric as text, followed by its interval in brackets if it has one."""
    text = shown_number(metric, value)
    if low is None or high is None:
        return text
    return f"{text} [{shown_number(metric, low)}, {shown_number(metric, high)}]"


def score_cells(numbers: Mapping[str, Any], metrics: Sequence[str], worse: Sequence[str] = ()) -> list[Cell]:
    """A cell for each metric.

    Args:
        numbers: by metric, as in a report.
        metrics: to show.
        worse: the metrics to mark.
    """
    return [Cell(shown_number(metric, numbers.get(metric)), marked=metric in worse) for metric in metrics]


def interval_cells(numbers: Mapping[str, Any], metrics: Sequence[str], worse: Sequence[str] = ()) -> list[Cell]:
    """As `score_cells`, with the intervals in `numbers`."""
    ends = {metric: numbers.get("intervals", {}).get(metric, (None, None)) for metric in metrics}
    return [
        Cell(with_interval(metric, numbers.get(metric), *ends[metric]), marked=metric in worse) for metric in metrics
    ]
