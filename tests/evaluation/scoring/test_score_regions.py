"""scripts/score_regions.py: speckle and borders, on maps counted by hand."""

from __future__ import annotations

import runpy
from pathlib import Path

import numpy as np

SCRIPT = runpy.run_path(str(Path(__file__).parents[3] / "scripts" / "score_regions.py"))


def test_speckle_is_the_share_of_pixels_in_regions_of_fewer_than_38():
    labels = np.zeros((10, 20), np.uint8)
    labels[2:4, 3:6] = 1  # 6 pixels
    labels[5:10, 10:18] = 2  # 40 pixels: no speckle
    labels[0, 19] = 2  # a region of its own, though of a large class
    assert SCRIPT["speckle"](labels) == 7 / 200


def test_the_border_is_three_pixels_wide_on_both_sides():
    labels = np.zeros((7, 12), np.uint8)
    labels[:, 5:] = 4
    assert np.flatnonzero(SCRIPT["near_border"](labels)[3]).tolist() == [2, 3, 4, 5, 6, 7]
