"""Differences between trainings, over scenes and seeds."""

from __future__ import annotations

import math

import numpy as np
import pytest

from semgs.evaluation.scoring.frame_scores import FrameScores
from semgs.evaluation.scoring.intervals import Trainings, paired_differences, seed_differences


def scores(psnr: list[float]) -> list[FrameScores]:
    return [FrameScores(f"room_{number}", "1.png", ("0.png", "2.png"), psnr=value) for number, value in enumerate(psnr)]


FLAT = [20.0] * 6


def row(*gains: float) -> Trainings:
    """A kind of training, with a seed for each gain over FLAT [dB], which all scenes have."""
    return [scores([20.0 + gain] * 6) for gain in gains]


def test_if_all_scenes_agree_the_interval_of_two_rows_is_students_over_the_seeds():
    """Gains of 1, 2 and 3 dB: mean 2, standard deviation 1, and Student's factor for two degrees of freedom is 4.3027."""
    found = seed_differences([row(5, 0, -2), row(6, 2, 1)])[0]["psnr"]
    assert found.value == pytest.approx(2)
    assert found.high - found.value == pytest.approx(4.3027 / math.sqrt(3), abs=1e-4)
    assert found.value - found.low == pytest.approx(4.3027 / math.sqrt(3), abs=1e-4)
    assert not found.excludes_zero


def test_if_all_seeds_agree_the_interval_is_that_over_scenes():
    after = [21.0, 22.0, 20.5, 23.0, 21.5, 20.0]
    alone = paired_differences(scores(FLAT), scores(after))["psnr"]
    found = seed_differences([[scores(FLAT)] * 2, [scores(after)] * 2])[0]["psnr"]
    assert (found.value, found.low, found.high) == pytest.approx((alone.value, alone.low, alone.high))
    assert found.value == pytest.approx(np.mean(after) - 20)
    one = seed_differences([[scores(FLAT)], [scores(after)]])[0]["psnr"]
    assert (one.low, one.high) == (alone.low, alone.high)


def test_both_add_in_squares():
    after = [21.0, 22.0, 20.5, 23.0, 21.5, 20.0]
    shifted = [scores([value + shift for value in after]) for shift in (-0.5, 0.5)]
    scenes = paired_differences(scores(FLAT), scores(after))["psnr"]
    found = seed_differences([row(0, 0), shifted])[0]["psnr"]
    half = 12.7062 * math.sqrt(0.5) / math.sqrt(2)  # Student's with one degree of freedom; the two differ by 1 dB
    assert found.high - found.value == pytest.approx(math.hypot(scenes.high - scenes.value, half), abs=1e-3)
    assert found.value - found.low == pytest.approx(math.hypot(scenes.value - scenes.low, half), abs=1e-3)


def test_rows_share_the_variance_that_is_left_without_their_means_and_those_of_the_seeds():
    """Of 0 0 0, 1 2 3 and 2 4 9, whose row means are 0, 2, 5, seed means 1, 2, 4 and mean 7/3, thirds are left: 4 1 -5, 1 1 -2, -5 -2 7.

    Their squares sum to 126 / 9 = 14, with four degrees of freedom, for which Student's factor is 2.7764. A difference of means over three
    seeds has a variance of 2 x 14 / 4 / 3.
    """
    half = 2.7764 * math.sqrt(7 / 3)
    first, second = (found["psnr"] for found in seed_differences([row(0, 0, 0), row(1, 2, 3), row(2, 4, 9)]))
    assert (first.value, second.value) == pytest.approx((2, 3))
    for found in (first, second):
        assert found.high - found.value == pytest.approx(half, abs=1e-3)
        assert found.value - found.low == pytest.approx(half, abs=1e-3)


def test_other_targets_other_seeds_and_no_seed_are_refused():
    with pytest.raises(ValueError, match="different targets"):
        seed_differences([row(0, 0), [scores(FLAT), scores(FLAT[1:])]])
    with pytest.raises(ValueError, match="the rows have 2, 1 seeds"):
        seed_differences([row(0, 0), row(0)])
    for none in ([], [row(0)], [[], []]):
        with pytest.raises(ValueError, match="no trainings"):
            seed_differences(none)
