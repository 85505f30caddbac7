"""Calibration: temperatures, and how far confidence is from accuracy."""

import pytest
import torch

from semgs.evaluation.scoring.confidence_calibration import (
    expected_calibration_error,
    fitted_temperature,
    reliability,
)
from semgs.objectives.selective import counts_by_confidence, equal_mass_calibration_error
from semgs.rendering.temperatures import tempered

CLASSES = 20


def drawn(sharpness: float, count: int = 40_000) -> tuple[torch.Tensor, torch.Tensor]:
    """Distributions that are sharper than the truth by a factor, and labels drawn from the truth."""
    generator = torch.Generator().manual_seed(0)
    logits = 2 * torch.randn(count, CLASSES, generator=generator, dtype=torch.float64)
    labels = torch.multinomial(logits.softmax(-1), 1, generator=generator)[:, 0]
    return (sharpness * logits).softmax(-1), labels


@pytest.mark.parametrize("sharpness", [0.5, 1.0, 3.0])
def test_the_temperature_undoes_what_made_the_distributions_too_sharp_or_too_blunt(sharpness):
    distributions, labels = drawn(sharpness)
    assert fitted_temperature(distributions, labels) == pytest.approx(sharpness, rel=0.02)


def test_the_temperature_brings_the_calibration_error_down_and_moves_no_class():
    distributions, labels = drawn(3.0)
    after = tempered(distributions, fitted_temperature(distributions, labels))
    assert expected_calibration_error(distributions, labels) > 0.15
    assert expected_calibration_error(after, labels) < 0.01
    assert torch.equal(after.argmax(-1), distributions.argmax(-1))


def test_a_temperature_of_one_is_the_identity_and_heat_makes_all_classes_alike():
    distributions, _ = drawn(1.0, 100)
    torch.testing.assert_close(tempered(distributions, 1.0), distributions, rtol=1e-12, atol=1e-15)
    torch.testing.assert_close(
        tempered(distributions, 1e6), torch.full_like(distributions, 1 / CLASSES), rtol=1e-4, atol=0
    )
    with pytest.raises(ValueError, match="above 0"):
        tempered(distributions, 0.0)


def test_a_class_that_was_given_nothing_has_a_finite_cost_and_stays_last():
    distributions = torch.tensor([[1.0, 0.0, 0.0], [0.6, 0.4, 0.0]])
    found = tempered(distributions, fitted_temperature(distributions, torch.tensor([1, 0])))
    assert torch.isfinite(found).all()
    assert (found.argmax(-1) == 0).all()
    with pytest.raises(ValueError, match="no labelled pixels"):
        fitted_temperature(distributions[:0], torch.zeros(0, dtype=torch.long))


def test_the_reliability_bins_are_those_of_the_calibration_error():
    distributions, labels = drawn(2.0, 5_000)
    bins = reliability(distributions, labels)
    assert sum(one.share for one in bins) == pytest.approx(1)
    error = sum(one.share * abs(one.confidence - one.accuracy) for one in bins)
    assert error == pytest.approx(expected_calibration_error(distributions, labels), abs=1e-6)


def test_reliability_of_three_pixels_by_hand():
    distributions = torch.tensor([[0.9, 0.1], [0.7, 0.3], [0.2, 0.8]])
    (low, high) = reliability(distributions, torch.tensor([0, 1, 1]), bins=2)
    assert (low.share, low.confidence, low.accuracy) == (0, 0, 0)
    assert (high.share, high.confidence, high.accuracy) == pytest.approx((1, 0.8, 2 / 3))


def test_a_probability_that_rounding_puts_above_one_counts_as_one():
    """Of three certain pixels two are right, so the error is 1/3."""
    labels = torch.tensor([0, 0, 1])
    certain = torch.tensor([[1.0, 0.0]]).repeat(3, 1)
    for distributions in (certain, certain * (1 + 1e-6)):
        assert expected_calibration_error(distributions, labels) == pytest.approx(1 / 3)
        counts = counts_by_confidence(distributions[:, 0], labels == 0)
        assert equal_mass_calibration_error(counts) == pytest.approx(1 / 3, abs=1e-4)
