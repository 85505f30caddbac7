"""docs/lab/learning_curve.py: the curve over core-hours and what the page says of it."""

from __future__ import annotations

import runpy
from pathlib import Path

import numpy as np
import pytest

LAB = Path(__file__).parents[2] / "docs" / "lab"
CURVE = runpy.run_path(str(LAB / "learning_curve.py"))


def test_a_score_that_gains_a_tenth_at_each_doubling():
    gain, start = CURVE["doublings"](np.array([2.0, 4.0, 8.0]), np.array([0.3, 0.4, 0.5]))
    assert (gain, start) == (pytest.approx(0.1), pytest.approx(0.2))


def test_the_page_says_what_the_table_gives():
    names, rows = CURVE["table"]()
    assert names == ["validation rooms", "other", "small_house"]
    fits = [CURVE["doublings"](rows[:, 0], scores) for scores in rows[:, 1:].T]
    gains = [f"{gain:.3f}" for gain, _ in fits]
    next_ones = [f"{start + gain * np.log2(2 * rows[-1, 0]):.2f}" for gain, start in fits]
    page = (LAB / "experiments.md").read_text("utf-8")
    assert f"A doubling gave {gains[0]}, {gains[1]} and {gains[2]}." in page
    assert f"would lead to about {next_ones[0]}, {next_ones[1]} and {next_ones[2]}." in page
