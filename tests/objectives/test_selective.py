"""Selective classification against loops over sorted pixels, and by hand."""

from __future__ import annotations

import math

import numpy as np
import pytest
import torch

from semgs.objectives.selective import (
    BINS,
    LEVELS,
    area_under_risk_coverage,
    confidences,
    counts_by_confidence,
    coverage_at_risk,
    equal_mass_calibration_error,
    least_confidence,
    risks,
)


def pixels(seed: int, count: int = 3_000) -> tuple[torch.Tensor, torch.Tensor]:
    """Confidences, most of them high, and whether the pixel is right: too seldom."""
    generator = torch.Generator().manual_seed(seed)
    confidence = torch.sigmoid(3 * torch.randn(count, generator=generator, dtype=torch.float64) + 2)
    return confidence, torch.rand(count, generator=generator, dtype=torch.float64) < confidence**1.5


def ranked(confidence: torch.Tensor, right: torch.Tensor) -> list[tuple[float, float]]:
    """Confidence and error of each pixel, the most confident first; of pixels with the same level each has their mean error."""
    levels = (torch.logit(confidence) / 0.05).round().clamp(-120, 240)
    rows = []
    for level in sorted(set(levels.tolist()), reverse=True):
        those = levels == level
        error = 1 - right[those].double().mean().item()
        rows += [(1 / (1 + math.exp(-0.05 * level)), error)] * int(those.sum())
    return rows


def risk_by_a_loop(rows: list[tuple[float, float]], count: int) -> float:
    return sum(error for _, error in rows[:count]) / count


def test_two_levels_by_hand() -> None:
    """50 sure pixels, all right, and 50 unsure ones, 20 of which are wrong. After x > 50 pixels the risk is 0.4 (x - 50) / x, whose mean over 0..100 is
    0.2 - 0.2 log 2 = 0.0614. Half of the pixels: 0; 80 %: 12 / 80; all: 0.2."""
    confidence = torch.tensor([0.95] * 50 + [0.7] * 50)
    counts = counts_by_confidence(confidence, torch.tensor([True] * 80 + [False] * 20))
    assert counts.sum(0).tolist() == [100, 80]
    assert area_under_risk_coverage(counts) == pytest.approx(0.2 - 0.2 * math.log(2))
    assert risks(counts, (0.3, 0.5, 0.8, 1.0)).tolist() == pytest.approx([0, 0, 0.15, 0.2])
    assert least_confidence(counts, 0.5) == pytest.approx(0.95, abs=0.005)
    assert least_confidence(counts, 0.51) == pytest.approx(0.7, abs=0.01)
    sure, unsure = 0.95 - 1, 0.7 - 0.6  # confidence minus accuracy
    assert equal_mass_calibration_error(counts, 2) == pytest.approx(0.5 * abs(sure) + 0.5 * unsure, abs=0.005)
    assert equal_mass_calibration_error(counts, 1) == pytest.approx(abs(sure + unsure) / 2, abs=0.005)


def test_all_alike_has_the_share_of_errors_as_its_area() -> None:
    counts = counts_by_confidence(torch.full((10,), 0.6), torch.arange(10) < 7)
    assert area_under_risk_coverage(counts) == pytest.approx(0.3)
    assert risks(counts, (0.1, 1.0)).tolist() == pytest.approx([0.3, 0.3])


@pytest.mark.parametrize("seed", [0, 1])
def test_the_area_is_the_mean_of_the_risk_over_all_counts_of_pixels(seed: int) -> None:
    confidence, right = pixels(seed)
    rows = ranked(confidence, right)
    slow = sum(risk_by_a_loop(rows, count) for count in range(1, len(rows) + 1)) / len(rows)
    counts = counts_by_confidence(confidence, right)
    assert area_under_risk_coverage(counts) == pytest.approx(slow, abs=2 / len(rows))
    for coverage in (0.1, 0.5, 0.9, 1.0):
        found = float(risks(counts, (coverage,))[0])
        assert found == pytest.approx(risk_by_a_loop(rows, round(coverage * len(rows))), rel=1e-9)


@pytest.mark.parametrize("seed", [0, 1])
def test_the_calibration_error_is_that_of_sorted_pixels_cut_into_15_equal_parts(seed: int) -> None:
    confidence, right = pixels(seed)
    rows = ranked(confidence, right)
    size = len(rows) // BINS
    slow = 0.0
    for first in range(0, len(rows), size):
        part = rows[first : first + size]
        slow += abs(sum(sure - (1 - error) for sure, error in part)) / len(rows)
    found = equal_mass_calibration_error(counts_by_confidence(confidence, right))
    assert found == pytest.approx(slow, rel=1e-9)
    assert found > 0.05


def test_levels_hide_little() -> None:
    """With the pixels' own confidence in place of that of their level."""
    confidence, right = pixels(2, 30_000)
    order = confidence.argsort(descending=True)
    wrong = (~right[order]).double()
    count = torch.arange(1, len(order) + 1)
    counts = counts_by_confidence(confidence, right)
    assert area_under_risk_coverage(counts) == pytest.approx((wrong.cumsum(0) / count).mean().item(), abs=2e-3)
    parts = (confidence[order] - right[order].double()).reshape(BINS, -1)
    assert equal_mass_calibration_error(counts) == pytest.approx(parts.mean(1).abs().mean().item(), abs=2e-3)


def test_several_sets_at_once_are_as_one_after_the_other() -> None:
    sets = np.stack([counts_by_confidence(*pixels(seed)) for seed in range(3)])
    for function in (area_under_risk_coverage, equal_mass_calibration_error, lambda some: risks(some, (0.2, 0.7))):
        together = function(sets)
        assert together.tolist() == [function(one).tolist() for one in sets]


def test_impossible_and_certain_confidences_have_the_outermost_levels() -> None:
    counts = counts_by_confidence(torch.tensor([1.0, 1e-9]), torch.tensor([True, False]))
    assert counts[-1].tolist() == [1, 1]
    assert counts[0].tolist() == [1, 0]
    assert counts.shape == (LEVELS, 2)
    assert confidences()[[0, -1]].tolist() == pytest.approx([1 / (1 + math.exp(6)), 1 / (1 + math.exp(-12))])


def test_as_many_pixels_count_as_errors_allow():
    """100 right, then 50 with 10 errors, then 50 wrong ones. After x > 100, 0.2 (x - 100) are wrong: 5 % at 0.15 x = 20, of 200. Sets go together."""
    counts = np.zeros((2, LEVELS, 2), int)
    counts[0, -3:] = (50, 0), (50, 40), (100, 100)
    counts[1, 7] = (10, 10)
    np.testing.assert_allclose(coverage_at_risk(counts, 0.05), [20 / 0.15 / 200, 1.0])
    counts[1, 7] = (10, 0)
    assert coverage_at_risk(counts[1], 0.05) == 0
    # Of 40 %: after 150 pixels 10 are wrong, then all are: 10 + x - 150 = 0.4 x.
    np.testing.assert_allclose(coverage_at_risk(counts[0], 0.4), min(1, 140 / 0.6 / 200))
    np.testing.assert_allclose(coverage_at_risk(counts[0], 0.2), 140 / 0.8 / 200)


@pytest.mark.parametrize("seed", range(3))
def test_it_is_the_last_place_where_the_risk_is_low_enough(seed: int):
    confidence, right = pixels(seed)
    counts = counts_by_confidence(confidence, right)
    found = float(coverage_at_risk(counts, 0.1))
    shares = np.arange(1, 3001) / 3000
    fits = risks(counts, shares.tolist()) <= 0.1
    assert abs(found - (shares[fits].max() if fits.any() else 0)) <= 1 / 3000
