"""The fit of the network's depth to the sensor's, by hand."""

from __future__ import annotations

import pytest
import torch

from semgs.depth_maps.depth_fit import DepthFit, line

NETWORK = 1 / torch.linspace(0.2, 1.0, 900, dtype=torch.float64).reshape(30, 30)
"""Inverse depths evenly from 0.2 to 1: 1 m to 5 m."""


def sensed(scale: float, shift: float) -> torch.Tensor:
    return 1 / (scale / NETWORK + shift)


def test_scale_and_shift_come_back():
    """1 / sensor = 0.8 / network + 0.1: the network's 2 m are 1 / 0.5 = 2 m, its 1 m are 1 / 0.9 m."""
    fit = DepthFit.of(NETWORK, sensed(0.8, 0.1))
    assert (fit.scale, fit.shift) == (pytest.approx(0.8), pytest.approx(0.1))
    assert (fit.measured, fit.residual) == (1, pytest.approx(0, abs=1e-9))
    assert fit(torch.tensor([2.0, 1.0])).tolist() == pytest.approx([2.0, 1 / 0.9])
    assert not fit.poor


def test_forty_percent_of_outliers_have_no_vote():
    """Where least squares would find a shift of 0.22 / m, 360 of 900 pixels at 0.5 m change nothing."""
    sensor = sensed(0.8, 0.1)
    sensor.view(-1)[::5] = 0.5
    sensor.view(-1)[3::5] = 0.5
    x, y = 1 / NETWORK.flatten(), 1 / sensor.flatten()
    least_squares = torch.linalg.lstsq(torch.stack((x, torch.ones_like(x)), 1), y[:, None]).solution[1].item()
    assert least_squares > 0.5
    fit = DepthFit.of(NETWORK, sensor)
    assert (fit.scale, fit.shift) == (pytest.approx(0.8, abs=1e-3), pytest.approx(0.1, abs=1e-3))


def test_pixels_that_are_not_measured_do_not_count():
    sensor = sensed(0.8, 0.1)
    sensor[:12] = 0
    fit = DepthFit.of(NETWORK, sensor)
    assert fit.measured == pytest.approx(0.6)
    assert (fit.scale, fit.shift) == (pytest.approx(0.8), pytest.approx(0.1))


def test_the_residual_is_the_typical_relative_error():
    """Noise of 5 % of the depth: the robust deviation is 0.05."""
    noise = torch.randn(NETWORK.shape, generator=torch.Generator().manual_seed(0), dtype=torch.float64)
    fit = DepthFit.of(NETWORK, sensed(1, 0) * (1 + 0.05 * noise))
    assert fit.residual == pytest.approx(0.05, rel=0.1)
    assert fit.scale == pytest.approx(1, abs=0.02)


def test_a_wall_that_determines_no_shift_has_the_median_ratio():
    wall = torch.full((4, 5), 2.0)
    sensor = torch.full((4, 5), 2.5)
    sensor[0] = 9.0
    fit = DepthFit.of(wall, sensor)
    assert (fit.scale, fit.ratio) == (pytest.approx(0.8), pytest.approx(1.25))
    assert fit.shift == pytest.approx(0, abs=1e-6)


def test_depth_that_falls_where_the_networks_rises_does_not_fall_in_the_fit():
    slope, _ = line(torch.tensor([1.0, 2, 3, 4, 5]), torch.tensor([5.0, 4, 3, 2, 1]))
    assert slope > 0


def test_the_slope_of_noisy_depths_stays_nearer_to_the_median_ratio():
    """y = 0.5 x + 0.25 over 0.2 to 0.8: median ratio 1, variance 0.03, covariance 0.015.

    Noise of 0.05 has the weight 0.05^2 / 0.03 = 0.083: (0.015 + 0.083) / (0.03 + 0.083) = 0.87. Without noise the slope is 0.5.
    """
    generator = torch.Generator().manual_seed(1)
    x = torch.linspace(0.2, 0.8, 4001, dtype=torch.float64)
    y = 0.5 * x + 0.25
    assert line(x, y)[0] == pytest.approx(0.5, abs=1e-6)
    noisy = y + 0.05 * torch.randn(len(x), generator=generator, dtype=torch.float64)
    assert line(x, noisy)[0] == pytest.approx(0.87, abs=0.02)


def test_no_depth_becomes_negative_or_more_than_ten_times_as_large():
    """1 / sensor = 1 / network - 0.3: the network's 5 m would be at -10 m."""
    fit = DepthFit(1.0, 1.0, 1.0, -0.3, 0.0)
    assert fit(torch.tensor([2.0, 5.0])).tolist() == pytest.approx([5.0, 50.0])


@pytest.mark.parametrize("factor", [10.0, 1000.0, 0.1, 3.28])
def test_depth_in_another_unit_is_a_poor_fit_though_its_residual_is_zero(factor: float):
    fit = DepthFit.of(NETWORK, factor * NETWORK)
    assert fit.ratio == pytest.approx(factor)
    assert fit.residual < 1e-6
    assert fit.poor


def test_a_view_without_any_measurement_is_refused():
    with pytest.raises(ValueError, match="measured nothing"):
        DepthFit.of(NETWORK, torch.zeros(30, 30))
