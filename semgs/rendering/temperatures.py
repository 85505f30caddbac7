"""Temperatures: they turn class distributions into calibrated probabilities.

A temperature T takes the distribution p to softmax(log p / T) (Guo et al., "On calibration of modern neural networks", ICML 2017). It never changes the order of
the classes, so arg max and every class metric stay as they are. `semgs.evaluation.scoring.confidence_calibration` fits temperatures.
"""

from __future__ import annotations

from dataclasses import dataclass
from math import inf

import torch
from jaxtyping import Float
from torch import Tensor

from semgs.files.errors import check_type
from semgs.runtime.precision import in_full


@dataclass(frozen=True)
class Temperatures:
    """The temperatures that were fitted for some weights.

    Attributes:
        rendered: for the pixels of a rendered class map.
        gaussians: for single Gaussians.

    Raises:
        ValueError: one is not a positive number.
    """

    rendered: float
    gaussians: float

    def __post_init__(self) -> None:
        for kind, value in vars(self).items():
            if not isinstance(value, int | float) or not 0 < value < inf:
                raise ValueError(f"the temperature {kind} is {value!r}; expected a number above 0")


def tempered(distributions: Float[Tensor, "*batch class"], temperature: float) -> Float[Tensor, "*batch class"]:
    """softmax(log p / T) of distributions over their last axis; a T of 1 changes nothing but rounding.

    Raises:
        ValueError: the temperature is not positive.
    """
    check_type(
        "distributions are", distributions, Tensor, "a tensor, such as rendering.semantics moved to its last axis"
    )
    if not temperature > 0:
        raise ValueError(f"a temperature of {temperature}; expected one above 0")
    return (logarithms(distributions) / temperature).softmax(-1)


def logarithms(distributions: Float[Tensor, "*batch class"]) -> Float[Tensor, "*batch class"]:
    """log p in float32 or better; the smallest normal number replaces zeros."""
    exact = in_full(distributions)
    return exact.clamp(min=torch.finfo(exact.dtype).tiny).log()


def highest_probability(
    distributions: Float[Tensor, "*batch class"], temperature: float | None
) -> Float[Tensor, "*batch"]:
    """The calibrated probability of the likeliest class; uncalibrated if the temperature is None (unknown)."""
    if temperature is None:
        return distributions.amax(-1)
    return tempered(distributions, temperature).amax(-1)
