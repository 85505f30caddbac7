"""Measuring: every run in turn, then all of them again, so that what disturbs the machine for a while disturbs all alike."""

from __future__ import annotations

from collections.abc import Callable, Hashable, Mapping
from typing import TypeVar

REPEATS = 5
WARM_UPS = 2
BEYOND_SECONDS = 20.0
"""What takes longer is measured once, and by its first run."""

WHOLE = "total"
"""The part of a run that is all of it."""

Seconds = Mapping[str, float]
"""Seconds by part of a run; the one named `WHOLE` is all of it."""

Key = TypeVar("Key", bound=Hashable)


class CannotMeasureError(Exception):
    """Something that cannot be measured here; the text is the reason, as the table shows it."""


def measure(
    runs: Mapping[Key, Callable[[], Seconds]],
    *,
    repeats: int = REPEATS,
    warm_ups: int = WARM_UPS,
    done: Callable[[Key], None] = lambda key: None,
) -> dict[Key, list[Seconds] | CannotMeasureError]:
    """Seconds of each run, one entry a repeat.

    Args:
        runs: each does its work once and says how long its parts took.
        repeats: how often each is measured, in rounds over all of them.
        warm_ups: runs of each before that, which compile, load and fill caches.
        done: told of every run that is done.

    Returns:
        The seconds of the repeats; of a run that takes more than `BEYOND_SECONDS` its first seconds; the error of one that
        raised `CannotMeasureError`.
    """
    found: dict[Key, list[Seconds] | CannotMeasureError] = {}
    going: list[Key] = []
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
        except CannotMeasureError as error:
            found[key] = error
            continue
        going.append(key)
    times: dict[Key, list[Seconds]] = {key: [] for key in going}
    for _ in range(repeats):
        for key in going:
            times[key].append(runs[key]())
            done(key)
    return {key: found[key] if key in found else times[key] for key in runs}
