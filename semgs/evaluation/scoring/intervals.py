"""Bootstrap intervals: how much a number would change with other scenes, or at least with other frames of the same scenes.

With five or more scenes, scenes are resampled; with fewer, single targets. The latter says less: targets of one scene are
similar, so the interval is too narrow for other scenes. The seed is fixed, so numbers repeat.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Literal

import numpy as np
from scipy.stats import bootstrap

from semgs.evaluation.scoring.frame_scores import FrameScores
from semgs.evaluation.scoring.summary import MetricGroup, Values, group_metrics

LEVEL = 0.95
RESAMPLES = 5000
FEWEST_SCENES = 5
SEED = 0
_BATCH = 500
"""Resamples processed at a time; limits the memory for matrices of many classes."""

Over = Literal["scenes", "frames"]


@dataclass(frozen=True)
class Interval:
    """A number and the ends of its interval."""

    value: float
    low: float
    high: float

    @property
    def excludes_zero(self) -> bool:
        """Whether both ends are on one side of 0."""
        return self.low > 0 or self.high < 0


def choose_units(frames: Sequence[FrameScores]) -> Over:
    """What is resampled: scenes if there are five or more, else frames."""
    return "scenes" if len({frame.scene for frame in frames}) >= FEWEST_SCENES else "frames"


def intervals(frames: Sequence[FrameScores]) -> dict[str, Interval]:
    """The 95 % percentile interval of every metric that two or more scenes (or frames) have."""
    over = choose_units(frames)
    found: dict[str, Interval] = {}
    for group in group_metrics(frames):
        found |= group_intervals(group, over)
    return found


def paired_differences(first: Sequence[FrameScores], second: Sequence[FrameScores]) -> dict[str, Interval]:
    """Second minus first for every metric that both have, with intervals from resampling the same scenes or frames in both.

    Args:
        first, second: of the same targets in the same order.

    Raises:
        ValueError: the targets differ.
    """
    if [(one.scene, one.target) for one in first] != [(one.scene, one.target) for one in second]:
        raise ValueError("the scores are of different targets; expected the same targets in the same order")
    over = choose_units(first)
    others = {group.names: group for group in group_metrics(second)}
    found: dict[str, Interval] = {}
    for group in group_metrics(first):
        other = others.get(group.names)
        if other is not None and np.array_equal(group.scene_of, other.scene_of):
            found |= group_intervals(group, over, lambda *times, a=group, b=other: b.values(*times) - a.values(*times))
    return found


def group_intervals(group: MetricGroup, over: Over, values: Values | None = None) -> dict[str, Interval]:
    """The intervals of a group of metrics; none for a single scene or frame, or if a metric is infinite.

    Args:
        group: the metrics.
        over: what is resampled.
        values: computes other numbers from the same targets; None for those of the group.
    """
    values = values or group.values
    scenes = int(group.scene_of.max()) + 1
    count = scenes if over == "scenes" else len(group.scene_of)
    if count < 2:
        return {}

    def statistic(drawn: np.ndarray, axis: int = -1) -> np.ndarray:
        """The metrics [metric ...] of resampled units [... count]."""
        flat = drawn.reshape(-1, count)
        times = np.zeros((len(flat), count), np.int64)
        np.add.at(times, (np.arange(len(flat))[:, None], flat), 1)
        if over == "scenes":
            found = values(times[:, group.scene_of], times)
        else:
            found = values(times, np.ones((len(flat), scenes), np.int64))
        return found.reshape(-1, *drawn.shape[:-1])

    once = statistic(np.arange(count))
    if not np.isfinite(once).all():
        return {}
    drawn = bootstrap(
        (np.arange(count),), statistic, vectorized=True, axis=-1, n_resamples=RESAMPLES, batch=_BATCH,
        confidence_level=LEVEL, method="percentile", rng=np.random.default_rng(SEED),
    )  # fmt: skip
    low, high = drawn.confidence_interval
    ends = zip(group.names, once.tolist(), np.atleast_1d(low).tolist(), np.atleast_1d(high).tolist(), strict=True)
    return {name: Interval(*numbers) for name, *numbers in ends}
