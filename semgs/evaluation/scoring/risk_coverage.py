"""Risk-coverage curves: the share of wrong classes if only the most confident pixels count, with intervals."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import final

import numpy as np

from semgs.evaluation.scoring.frame_scores import FrameScores
from semgs.evaluation.scoring.intervals import choose_units, group_intervals
from semgs.evaluation.scoring.summary import group_confidences
from semgs.objectives.selective import least_confidence, risks

COVERAGES = tuple(step / 20 for step in range(1, 21))
"""The shares of the pixels at which a curve is computed."""


@final
@dataclass(frozen=True)
class RiskPoint:
    """A point of a curve.

    Attributes:
        coverage: the share of the pixels that count, the most confident ones.
        risk: the share of these whose class is wrong.
        low, high: the 95 % interval of the risk; None for a single scene and frame.
        confidence: which these pixels have at least.
    """

    coverage: float
    risk: float
    low: float | None
    high: float | None
    confidence: float


def risk_coverage(frames: Sequence[FrameScores]) -> tuple[RiskPoint, ...]:
    """The curve of some targets, over their labelled and seen pixels; empty if there is no confidence."""
    counts = [frame.confidences for frame in frames if frame.confidences is not None]
    total = np.sum(counts, axis=0) if counts else np.zeros((1, 2), np.int64)
    if not total.any():
        return ()
    names = tuple(f"{coverage:.2f}" for coverage in COVERAGES)
    group = group_confidences(frames, names, lambda summed: risks(summed, COVERAGES))
    found = group_intervals(group, choose_units(frames))
    return tuple(
        RiskPoint(
            coverage,
            risk,
            found[name].low if name in found else None,
            found[name].high if name in found else None,
            least_confidence(total, coverage),
        )
        for coverage, name, risk in zip(COVERAGES, names, risks(total, COVERAGES).tolist(), strict=True)
    )
