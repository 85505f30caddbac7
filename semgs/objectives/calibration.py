"""Calibration: are predictions with 80 % confidence right in 80 % of cases? One temperature brings them closer to that.

`semgs.rendering.temperatures` says what a temperature does to a rendered pixel or to a Gaussian's own distribution.
"""

from __future__ import annotations

from dataclasses import dataclass

import torch
from jaxtyping import Float, Int
from scipy.optimize import minimize_scalar
from torch import Tensor
from torchmetrics.functional.classification import multiclass_calibration_error

from semgs.rendering.temperatures import logarithms

BINS = 15
"""Bins of confidence, equally wide, as in Guo et al."""

COLDEST, HOTTEST = 0.05, 20.0
"""Range in which a temperature is searched."""


@dataclass(frozen=True)
class Bin:
    """Pixels whose largest probability lies in a range.

    Attributes:
        share: of all pixels.
        confidence: mean of their largest probability, 0 without pixels.
        accuracy: share of them that are right, 0 without pixels.
    """

    share: float
    confidence: float
    accuracy: float


def fitted_temperature(distributions: Float[Tensor, "n class"], labels: Int[Tensor, " n"]) -> float:
    """The temperature that minimises the negative log-likelihood of labelled distributions, between 0.05 and 20.

    The negative log-likelihood is convex in 1 / T, so a bounded search over 1 / T finds its only minimum.

    Raises:
        ValueError: there are no labels.
    """
    if not len(labels):
        raise ValueError("there are no labelled pixels to fit a temperature to")
    logged = logarithms(distributions.double())

    def mean_cost(inverse: float) -> float:
        return float(torch.nn.functional.cross_entropy(logged * inverse, labels.long()))

    found = minimize_scalar(mean_cost, bounds=(1 / HOTTEST, 1 / COLDEST), method="bounded", options={"xatol": 1e-4})
    return 1 / float(found.x)


def expected_calibration_error(
    distributions: Float[Tensor, "n class"], labels: Int[Tensor, " n"], bins: int = BINS
) -> float:
    """Mean over pixels of |confidence - accuracy| of their bin (ECE), by torchmetrics."""
    distributions = distributions.clamp(max=1)  # torchmetrics would take them for logits if rounding put one above 1
    return float(multiclass_calibration_error(distributions, labels.long(), distributions.shape[-1], bins, "l1"))


def reliability(
    distributions: Float[Tensor, "n class"], labels: Int[Tensor, " n"], bins: int = BINS
) -> tuple[Bin, ...]:
    """The bins of a reliability plot: pixels by their largest probability, in (low, high], and how many were right."""
    confidence, said = distributions.double().max(-1)
    right = (said == labels).double()
    of = torch.bucketize(confidence, torch.linspace(0, 1, bins + 1, dtype=torch.float64)[1:-1])
    counts = torch.bincount(of, minlength=bins).double()
    sums = [torch.bincount(of, weights=values, minlength=bins) / counts.clamp(min=1) for values in (confidence, right)]
    return tuple(Bin(*row) for row in torch.stack((counts / max(len(labels), 1), *sums), 1).tolist())
