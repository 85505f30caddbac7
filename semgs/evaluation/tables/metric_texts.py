"""Metrics and their intervals as text. No torch."""

from __future__ import annotations

from semgs.objectives.measures import shown_number


def with_interval(metric: str, value: float | None, low: float | None, high: float | None) -> str:
    """A metric as text, followed by its interval in brackets if it has one."""
    text = shown_number(metric, value)
    if low is None or high is None:
        return text
    return f"{text} [{shown_number(metric, low)}, {shown_number(metric, high)}]"
