"""scripts/score_regions.py: borders, on a map counted by hand."""

from __future__ import annotations

import runpy
from pathlib import Path

import numpy as np

SCRIPT = runpy.run_path(str(Path(__file__).parents[3] / "scripts" / "score_regions.py"))


def test_the_border_is_three_pixels_wide_on_both_sides():
    labels = np.zeros((7, 12), np.uint8)
    labels[:, 5:] = 4
    assert np.flatnonzero(SCRIPT["near_border"](labels)[3]).tolist() == [2, 3, 4, 5, 6, 7]
