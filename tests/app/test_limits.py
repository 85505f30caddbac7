"""Limits in words."""

from __future__ import annotations

import math

import pytest

from semgs.app.limits import Limits


@pytest.mark.parametrize(
    ("hours", "words"),
    [
        (24, "a day"),
        (48, "2 days"),
        (36, "36 hours"),
        (1, "an hour"),
        (1.1, "66 minutes"),
        (1 / 60, "a minute"),
        (0.001, "a minute"),
        (math.inf, "an unlimited time"),
    ],
)
def test_how_long_rooms_are_kept_is_said_in_the_largest_unit_that_fits(hours: float, words: str) -> None:
    assert Limits(kept_seconds=3600 * hours).kept == words
