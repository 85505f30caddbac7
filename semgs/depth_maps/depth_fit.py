"""The fit of a network's depth to that of a sensor: by how much they differ, and what the sensor would have measured.

It is linear in inverse depth, 1 / sensor = scale / network + shift. There both errors are even: the noise of stereo and of structured light grows
with the square of depth, and the candidates of a plane sweep are evenly spaced in inverse depth. It is robust: it starts from the median ratio,
then repeats least squares with Tukey's weights, which give outliers no vote. The noisier the depths, the more the slope stays at that ratio:
errors of a network are alike over large areas, and a shift fitted to them misleads where nothing was measured. In 18 pairs of views of rooms the
mean error there was 12.3 % without a fit, 12.1 % with plain least squares, 11.6 % like this, and 11.4 % with the median ratio alone.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import final

from jaxtyping import Float
from torch import Tensor

ROUNDS = 20
"""Rounds of weighted least squares."""

TUKEY = 4.685
"""Residuals of more standard deviations than this have no weight."""

SIGMA_PER_MAD = 1.4826
"""Standard deviation of a normal distribution per median absolute deviation."""

TRUST = 0.03
"""How far the slope may leave the median ratio: a view counts as 3 independent measurements, with a relative deviation of 0.1 between slope and
ratio: 3 * 0.1^2."""

LEAST = 0.1
"""The shift reduces no inverse depth to less than this share of it: no depth becomes negative, or more than ten times as large."""

ALIKE = 1.5
"""If the median ratio is further from 1 than this factor, units or poses are wrong; the networks do not err that much."""

POOR = 0.2
"""A fit with a larger residual is poor."""


@final
@dataclass(frozen=True)
class DepthFit:
    """How a sensor's depth of one view compares with the network's.

    Attributes:
        measured: share of the pixels that the sensor measured, 0..1.
        ratio: the median of sensor / network.
        scale: of the fit.
        shift: of the fit [1 / m].
        residual: robust standard deviation of log depth after the fit: 0.1 is about 10 % of the depth.
    """

    measured: float
    ratio: float
    scale: float
    shift: float
    residual: float

    @staticmethod
    def of(network: Float[Tensor, "h w"], sensor: Float[Tensor, "h w"]) -> DepthFit:
        """The fit of a view.

        Args:
            network: z-depth of every pixel [m].
            sensor: the same; 0 where nothing was measured.

        Raises:
            ValueError: nothing was measured.
        """
        known = sensor > 0
        if not known.any():
            raise ValueError("the sensor measured nothing")
        x, y = (1 / depths[known].double() for depths in (network, sensor))
        scale, shift = line(x, y)
        errors = (_inverse(x, scale, shift) / y).log().abs()
        return DepthFit(
            float(known.double().mean()), float((x / y).median()), scale, shift, SIGMA_PER_MAD * float(errors.median())
        )

    def __call__(self, network: Float[Tensor, "*n"]) -> Float[Tensor, "*n"]:
        """The depth that the sensor would measure, from the network's [m]."""
        return 1 / _inverse(1 / network, self.scale, self.shift)

    @property
    def poor(self) -> bool:
        """Whether the network and the sensor hardly saw the same depth."""
        return self.residual > POOR or not 1 / ALIKE <= self.ratio <= ALIKE


def line(x: Float[Tensor, " n"], y: Float[Tensor, " n"]) -> tuple[float, float]:
    """Slope and offset of y = slope x + offset, for positive numbers.

    Up to about half of the points may be outliers. If x hardly varies, or y does not grow with it, the slope is the median ratio and the
    offset about 0.
    """
    ratio = float((y / x).median())
    slope, offset = ratio, 0.0
    for _ in range(ROUNDS):
        sigma, weights = _noise(slope * x + offset - y, y)
        slope, offset = _least_squares(x, y, weights, ratio, 0.0)
    sigma, weights = _noise(slope * x + offset - y, y)
    return _least_squares(x, y, weights, ratio, (sigma / ratio) ** 2 / TRUST)


def _noise(residuals: Float[Tensor, " n"], y: Float[Tensor, " n"]) -> tuple[float, Float[Tensor, " n"]]:
    """The robust standard deviation of residuals, and Tukey's weights, which sum to 1."""
    sigma = SIGMA_PER_MAD * float(residuals.abs().median()) + 1e-9 * float(y.median())
    weights = (1 - (residuals / (TUKEY * sigma)).square()).clamp(min=0).square()
    return sigma, weights / weights.sum()


def _least_squares(
    x: Float[Tensor, " n"], y: Float[Tensor, " n"], weights: Float[Tensor, " n"], ratio: float, prior: float
) -> tuple[float, float]:
    """Slope and offset; the slope is drawn towards `ratio` as if `prior` were added to the variance of x."""
    x_mean, y_mean = (weights * x).sum(), (weights * y).sum()
    variance, covariance = (weights * (x - x_mean).square()).sum(), (weights * (x - x_mean) * (y - y_mean)).sum()
    least = (1e-9 * float(x_mean)) ** 2  # x may be the same everywhere
    slope = max(float((covariance + (prior + least) * ratio) / (variance + prior + least)), LEAST * ratio)
    return slope, float(y_mean - slope * x_mean)


def _inverse(inverse: Float[Tensor, "*n"], scale: float, shift: float) -> Float[Tensor, "*n"]:
    """The line at inverse depths, kept positive."""
    scaled = scale * inverse
    return (scaled + shift).clamp(min=LEAST * scaled)
