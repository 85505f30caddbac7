"""Measures runs in rounds over all of them, so that a temporary disturbance of the machine affects all runs alike."""

from __future__ import annotations

from collections.abc import Callable, Hashable, Mapping
from typing import TypeVar

REPEATS = 5
WARM_UPS = 2
BEYOND_SECONDS = 20.0
"""A run that takes longer is measured only once, by its first run."""

WHOLE = "total"
"""The part of a run that contains all others."""

Seconds = Mapping[str, float]
"""Seconds by part of a run; `WHOLE` is the total."""

Key = TypeVar("Key", bound=Hashable)


class CannotMeasureError(Exception):
    """A run that cannot be measured here; the text is the reason, which the table shows."""


def measure(
    runs: Mapping[Key, Callable[[], Seconds]],
    *,
    repeats: int = REPEATS,
    warm_ups: int = WARM_UPS,
    done: Callable[[Key], None] = lambda key: None,
) -> dict[Key, list[Seconds] | CannotMeasureError]:
    """Seconds of each run, one entry per repeat.

    Args:
        runs: each does its work once and returns the seconds of its parts.
        repeats: how often each is measured, in rounds over all of them.
        warm_ups: runs before that, which compile, load and fill caches.
        done: called after every run.

    Returns:
        The seconds of the repeats. If a run takes more than `BEYOND_SECONDS`, those of its first run; if it raises
        `CannotMeasureError`, the error.
    """
    found: dict[Key, list[Seconds] | CannotMeasureError] = {}
    times: dict[Key, list[Seconds]] = {}
    for key, run in runs.items():
        try:
            first = run()
            done(key)
            if first[WHOLE] > BEYOND_SECONDS:
                found[key] = [first]
                continue
            for _ in range(warm_ups - 1):
                run()
                done(key)
            times[key] = []
        except CannotMeasureError as error:
            found[key] = error
    for _ in range(repeats):
        for key, seconds in times.items():
            seconds.append(runs[key]())
            done(key)
    return {key: found[key] if key in found else times[key] for key in runs}
