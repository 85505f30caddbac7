"""Bootstrap intervals: how much a number would change with other scenes, or at least with other frames of the same scenes.

With five or more scenes, scenes are resampled; with fewer, single targets. The latter says less: targets of one scene are
similar, so the interval is too narrow for other scenes. The seed is fixed, so numbers repeat.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from statistics import variance
from typing import Literal

import numpy as np
from scipy.stats import bootstrap, t

from semgs.evaluation.scoring.frame_scores import FrameScores
from semgs.evaluation.scoring.summary import MetricGroup, Values, group_metrics

LEVEL = 0.95
RESAMPLES = 5000
FEWEST_SCENES = 5
SEED = 0
_BATCH = 500
"""Resamples processed at a time; limits the memory for matrices of many classes."""

Over = Literal["scenes", "frames"]

Pair = tuple[Sequence[FrameScores], Sequence[FrameScores]]
"""Scores of two trainings with the same seed."""


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
    return seed_differences([[(first, second)]])[0]


def seed_differences(comparisons: Sequence[Sequence[Pair]]) -> list[dict[str, Interval]]:
    """For each comparison of two kinds of training: second minus first, the mean over seeds, for every metric that all seeds have.

    The interval says what other scenes and other seeds might have given: the distances of its ends are the root of the squares of two 95 %
    intervals. One resamples scenes (or frames) in all trainings alike. The other is Student's for the mean over the seeds, and takes the
    variance from all comparisons together, as two or three seeds alone say little about it. With one seed, there is only the first.

    Args:
        comparisons: the pairs of each seed; all with the same targets in the same order.

    Returns:
        The differences of each comparison, by metric.

    Raises:
        ValueError: there are no pairs, or the targets differ.
    """
    found = [_differences(pairs) for pairs in comparisons]
    metrics = {name for differences in found for name in differences}
    spreads = {name: _pooled([one[name].seeds for one in found if name in one]) for name in metrics}
    return [{name: one.interval(spreads[name]) for name, one in differences.items()} for differences in found]


@dataclass(frozen=True)
class _Difference:
    """A difference between two kinds of training: over scenes, with its interval, and for each seed."""

    over_scenes: Interval
    seeds: Sequence[float]

    def interval(self, spread: _Spread | None) -> Interval:
        """The interval over scenes, widened by how much seeds differ."""
        if spread is None:
            return self.over_scenes
        half = float(t.ppf((1 + LEVEL) / 2, spread.freedom)) * math.sqrt(spread.variance / len(self.seeds))
        value, low, high = self.over_scenes.value, self.over_scenes.low, self.over_scenes.high
        return Interval(value, value - math.hypot(value - low, half), value + math.hypot(high - value, half))


@dataclass(frozen=True)
class _Spread:
    """The variance of a difference between seeds, and the degrees of freedom of this estimate."""

    variance: float
    freedom: int


def _pooled(several: Sequence[Sequence[float]]) -> _Spread | None:
    """How much differences vary between seeds, from several comparisons; None if each has only one seed."""
    freedom = sum(len(seeds) - 1 for seeds in several)
    if not freedom:
        return None
    squares = sum((len(seeds) - 1) * variance(seeds) for seeds in several if len(seeds) > 1)
    return _Spread(squares / freedom, freedom)


def _differences(pairs: Sequence[Pair]) -> dict[str, _Difference]:
    """One comparison: the difference of every metric that all seeds have."""
    if not pairs:
        raise ValueError("there are no trainings to compare; expected a pair for each seed")
    targets = [[(one.scene, one.target) for one in frames] for pair in pairs for frames in pair]
    if any(other != targets[0] for other in targets):
        raise ValueError("the scores are of different targets; expected the same targets in the same order")
    over = choose_units(pairs[0][0])
    groups = [{group.names: group for group in group_metrics(frames)} for pair in pairs for frames in pair]
    found: dict[str, _Difference] = {}
    for names, group in groups[0].items():
        alike = [others[names] for others in groups if names in others]
        if len(alike) == len(groups) and all(np.array_equal(group.scene_of, one.scene_of) for one in alike):
            found |= _group_differences(alike[::2], alike[1::2], over)
    return found


def _group_differences(
    before: Sequence[MetricGroup], after: Sequence[MetricGroup], over: Over
) -> dict[str, _Difference]:
    """The differences of a group of metrics, which has one entry in `before` and one in `after` for each seed."""

    def values(times: np.ndarray, scene_times: np.ndarray) -> np.ndarray:
        pairs = zip(before, after, strict=True)
        return np.mean([b.values(times, scene_times) - a.values(times, scene_times) for a, b in pairs], axis=0)

    seeds = [(a.once(), b.once()) for a, b in zip(before, after, strict=True)]
    over_scenes = group_intervals(before[0], over, values)
    return {name: _Difference(one, [b[name] - a[name] for a, b in seeds]) for name, one in over_scenes.items()}


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
