"""Selective classification: how many classes are wrong if only the most confident pixels count (El-Yaniv and Wiener, JMLR 2010).

Pixels are counted by levels of confidence, so that the counts of frames and scenes can be added. Levels are even in log odds, because half of the pixels may have
a confidence above 0.99. Within a level, wrong pixels are spread evenly. All functions take counts of any number of sets at once.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import torch
from jaxtyping import Bool, Float, Float64, Int, Int64
from torch import Tensor

STEP = 0.05
"""Distance of two levels, in log odds."""

LOWEST, HIGHEST = -120, 240
"""The first and the last level: confidences of 0.0025 and 0.999994."""

LEVELS = HIGHEST - LOWEST + 1

BINS = 15
"""Bins of confidence with the same number of pixels."""

Counts = Int[np.ndarray, "*set level 2"]
"""For each level of confidence, the number of pixels, and how many of them are right."""


def counts_by_confidence(confidence: Float[Tensor, " n"], right: Bool[Tensor, " n"]) -> Int64[np.ndarray, "level 2"]:
    """Counts of some pixels.

    Args:
        confidence: the probability of their likeliest class, 0..1.
        right: whether it is the true one.
    """
    levels = (torch.logit(confidence.double().clamp(max=1)) / STEP).round().clamp(LOWEST, HIGHEST).long() - LOWEST
    return torch.stack([torch.bincount(some, minlength=LEVELS) for some in (levels, levels[right])], 1).numpy()


def confidences() -> Float64[np.ndarray, " level"]:
    """The confidence of each level."""
    return 1 / (1 + np.exp(-STEP * np.arange(LOWEST, HIGHEST + 1)))


def risks(counts: Counts, coverages: Sequence[float]) -> Float64[np.ndarray, "*set coverage"]:
    """The share of wrong pixels among the most confident ones.

    Args:
        counts: of at least one pixel in each set.
        coverages: which share of the pixels counts, above 0, at most 1.
    """
    pixels, wrong = _most_confident_first(counts)
    shares = np.asarray(coverages)
    return _sums_of_first(shares, pixels, wrong) / (shares * pixels.sum(-1, keepdims=True))


def least_confidence(counts: Int[np.ndarray, "level 2"], coverage: float) -> float:
    """The confidence that the most confident share of the pixels has at least."""
    pixels, _ = _most_confident_first(counts)
    place = np.searchsorted(np.cumsum(pixels), coverage * pixels.sum() * (1 - 1e-12))
    return float(confidences()[::-1][place])


def coverage_at_risk(counts: Counts, risk: float) -> Float64[np.ndarray, "*set"]:
    """The largest share of the pixels, the most confident ones, of which at most this share is wrong; for at least one pixel in each set.

    Within a level that begins after k pixels, of which e were wrong, and in which a share r is wrong, e + (x - k) r are wrong after x pixels: risk times x at
    x = (k r - e) / (r - risk).
    """
    pixels, wrong = _most_confident_first(counts)
    taken, missed = np.cumsum(pixels, -1), np.cumsum(wrong, -1)
    fits = missed <= risk * taken
    last = np.where(fits.any(-1), pixels.shape[-1] - 1 - np.argmax(fits[..., ::-1], -1), -1)[..., None]

    def at(values: np.ndarray, place: np.ndarray) -> np.ndarray:
        """Values at places of their last axis; 0 before the first."""
        found = np.take_along_axis(values, np.clip(place, 0, values.shape[-1] - 1), -1)
        return np.where(place < 0, 0, found)[..., 0]

    before, gone = at(taken, last), at(missed, last)
    following = np.minimum(last + 1, pixels.shape[-1] - 1)
    rate = at(wrong, following) / np.maximum(at(pixels, following), 1)
    with np.errstate(divide="ignore", invalid="ignore"):
        crossing = np.where(rate > risk, (before * rate - gone) / (rate - risk), before)
    return np.asarray(np.maximum(before, crossing) / taken[..., -1])


def area_under_risk_coverage(counts: Counts) -> Float64[np.ndarray, "*set"]:
    """The mean of the risk over all coverages (AURC), for at least one pixel in each set.

    Without any order it would be the share of all pixels that is wrong. Within a level that begins after k of n pixels, of which e were wrong, and has m pixels, of which w
    are wrong, the risk is (e + (x - k) w / m) / x after x pixels, which integrates to w + (e - k w / m) log((k + m) / k).
    """
    pixels, wrong = _most_confident_first(counts)
    taken, missed = np.cumsum(pixels, -1), np.cumsum(wrong, -1)
    before = taken - pixels
    rate = wrong / np.maximum(pixels, 1)
    growth = np.log(np.where(before > 0, taken / np.maximum(before, 1), 1))
    areas = wrong + (missed - wrong - rate * before) * growth
    return np.asarray(areas.sum(-1) / taken[..., -1])


def equal_mass_calibration_error(counts: Counts, bins: int = BINS) -> Float64[np.ndarray, "*set"]:
    """The mean over pixels of |confidence - accuracy| of their bin (ECE), for bins with the same number of pixels.

    With bins of the same width nearly all pixels are in the last one, where errors of both signs cancel.
    """
    pixels, wrong = _most_confident_first(counts)
    surplus = pixels * confidences()[::-1] - (pixels - wrong)  # confidence minus accuracy, times pixels
    sums = np.diff(_sums_of_first(np.arange(bins + 1) / bins, pixels, surplus))
    return np.asarray(np.abs(sums).sum(-1) / pixels.sum(-1))


def _most_confident_first(counts: Counts) -> tuple[Int[np.ndarray, "*set level"], Int[np.ndarray, "*set level"]]:
    """The pixels of each level, and how many of them are wrong."""
    pixels = counts[..., ::-1, 0]
    return pixels, pixels - counts[..., ::-1, 1]


def _sums_of_first(
    shares: Float64[np.ndarray, " share"],
    pixels: Int[np.ndarray, "*set level"],
    values: Int[np.ndarray, "*set level"] | Float64[np.ndarray, "*set level"],
) -> Float64[np.ndarray, "*set share"]:
    """The sum of a value over the first shares of all pixels, from its sum over each level."""
    ends, sums = (np.insert(np.cumsum(some, -1), 0, 0, -1).reshape(-1, some.shape[-1] + 1) for some in (pixels, values))
    found = [np.interp(shares * places[-1], places, those) for places, those in zip(ends, sums, strict=True)]
    return np.array(found).reshape(*pixels.shape[:-1], len(shares))
