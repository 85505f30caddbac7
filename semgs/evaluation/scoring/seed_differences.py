"""Differences between two trainings that were repeated with several seeds, with intervals over scenes and seeds."""

from __future__ import annotations

import math
from collections.abc import Sequence
from statistics import stdev

import numpy as np
from scipy.stats import t

from semgs.evaluation.scoring.frame_scores import FrameScores
from semgs.evaluation.scoring.intervals import LEVEL, Interval, choose_units, group_intervals
from semgs.evaluation.scoring.summary import MetricGroup, group_metrics

Pair = tuple[Sequence[FrameScores], Sequence[FrameScores]]
"""Scores of two trainings with the same seed."""


def seed_differences(pairs: Sequence[Pair]) -> dict[str, Interval]:
    """Second minus first, the mean over seeds, for every metric that all have.

    The interval says what other scenes and other seeds might have given: the distances of its ends are the root of the squares of two 95 %
    intervals. One resamples scenes (or frames) in all trainings alike; the other is Student's for the mean of so few seeds. With one seed,
    there is only the first.

    Args:
        pairs: of each seed; all with the same targets in the same order.

    Raises:
        ValueError: there are no pairs, or the targets differ.
    """
    if not pairs:
        raise ValueError("there are no trainings to compare; expected a pair for each seed")
    targets = [[(one.scene, one.target) for one in frames] for pair in pairs for frames in pair]
    if any(other != targets[0] for other in targets):
        raise ValueError("the scores are of different targets; expected the same targets in the same order")
    groups = [
        ({g.names: g for g in group_metrics(first)}, {g.names: g for g in group_metrics(second)})
        for first, second in pairs
    ]
    found: dict[str, Interval] = {}
    for names in groups[0][0]:
        if all(names in first and names in second for first, second in groups):
            found |= group_differences([(first[names], second[names]) for first, second in groups], pairs[0][0])
    return found


def group_differences(
    pairs: Sequence[tuple[MetricGroup, MetricGroup]], frames: Sequence[FrameScores]
) -> dict[str, Interval]:
    """The same for the metrics of one group.

    Args:
        pairs: the group of both trainings, for each seed.
        frames: the targets.
    """
    first = pairs[0][0]

    def values(times: np.ndarray, scene_times: np.ndarray) -> np.ndarray:
        each = [after.values(times, scene_times) - before.values(times, scene_times) for before, after in pairs]
        return np.mean(each, axis=0)

    over_scenes = group_intervals(first, choose_units(frames), values)
    once = [(before.once(), after.once()) for before, after in pairs]
    return {
        name: _wider(one, [after[name] - before[name] for before, after in once]) for name, one in over_scenes.items()
    }


def _wider(over_scenes: Interval, seeds: Sequence[float]) -> Interval:
    """An interval over scenes, widened by how much the seeds differ."""
    count = len(seeds)
    half = 0.0 if count < 2 else float(t.ppf((1 + LEVEL) / 2, count - 1)) * stdev(seeds) / math.sqrt(count)
    value = over_scenes.value
    return Interval(
        value, value - math.hypot(value - over_scenes.low, half), value + math.hypot(over_scenes.high - value, half)
    )
