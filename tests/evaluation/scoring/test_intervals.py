"""Differences between trainings, over scenes and seeds."""

from __future__ import annotations

import math

import numpy as np
import pytest

from semgs.evaluation.scoring.frame_scores import FrameScores
from semgs.evaluation.scoring.intervals import Pair, paired_differences, seed_differences


def scores(psnr: list[float]) -> list[FrameScores]:
    return [FrameScores(f"room_{number}", "1.png", ("0.png", "2.png"), psnr=value) for number, value in enumerate(psnr)]


FLAT = [20.0] * 6


def gains(*decibels: float) -> list[Pair]:
    """A seed for each gain, which all scenes have."""
    return [(scores(FLAT), scores([20.0 + gain] * 6)) for gain in decibels]


def test_if_all_scenes_agree_the_interval_is_students_over_the_seeds():
    """Gains of 1, 2 and 3 dB: mean 2, standard deviation 1, and Student's factor for two degrees of freedom is 4.3027."""
    found = seed_differences([gains(1, 2, 3)])[0]["psnr"]
    assert found.value == pytest.approx(2)
    assert found.high - found.value == pytest.approx(4.3027 / math.sqrt(3), abs=1e-4)
    assert found.value - found.low == pytest.approx(4.3027 / math.sqrt(3), abs=1e-4)
    assert not found.excludes_zero


def test_if_all_seeds_agree_the_interval_is_that_over_scenes():
    after = [21.0, 22.0, 20.5, 23.0, 21.5, 20.0]
    pair = scores(FLAT), scores(after)
    alone, found = paired_differences(*pair)["psnr"], seed_differences([[pair, pair]])[0]["psnr"]
    assert (found.value, found.low, found.high) == pytest.approx((alone.value, alone.low, alone.high))
    assert found.value == pytest.approx(np.mean(after) - 20)
    one = seed_differences([[pair]])[0]["psnr"]
    assert (one.low, one.high) == (alone.low, alone.high)


def test_both_add_in_squares():
    after = [21.0, 22.0, 20.5, 23.0, 21.5, 20.0]
    pairs = [(scores(FLAT), scores([value + shift for value in after])) for shift in (-0.5, 0.5)]
    scenes, found = paired_differences(scores(FLAT), scores(after))["psnr"], seed_differences([pairs])[0]["psnr"]
    half = 12.7062 * math.sqrt(0.5) / math.sqrt(2)  # Student's with one degree of freedom; the two differ by 1 dB
    assert found.high - found.value == pytest.approx(math.hypot(scenes.high - scenes.value, half), abs=1e-3)
    assert found.value - found.low == pytest.approx(math.hypot(scenes.value - scenes.low, half), abs=1e-3)


def test_how_much_seeds_differ_is_estimated_from_all_comparisons():
    """Variances of 1 and 4, each with two degrees of freedom: 2.5 with four, for which Student's factor is 2.7764."""
    half = 2.7764 * math.sqrt(2.5 / 3)
    for found in seed_differences([gains(1, 2, 3), gains(0, 2, 4)]):
        assert found["psnr"].high - 2 == pytest.approx(half, abs=1e-3)
        assert 2 - found["psnr"].low == pytest.approx(half, abs=1e-3)


def test_a_single_seed_varies_as_those_of_other_comparisons_do():
    three, one = (found["psnr"] for found in seed_differences([gains(1, 3, 5), gains(7)]))
    assert three.high - 3 == pytest.approx(4.3027 * 2 / math.sqrt(3), abs=1e-3)
    assert one.high - 7 == pytest.approx(4.3027 * 2, abs=1e-3)


def test_other_targets_and_no_seed_are_refused():
    with pytest.raises(ValueError, match="different targets"):
        seed_differences([[(scores(FLAT), scores(FLAT)), (scores(FLAT), scores(FLAT[1:]))]])
    with pytest.raises(ValueError, match="no trainings"):
        seed_differences([[]])
    assert seed_differences([]) == []
