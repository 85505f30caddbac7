"""Bootstrap intervals: how much a number would change with other scenes, or at least with other frames of the same scenes.

With five or more scenes, scenes are resampled; with fewer, single targets. The latter says less: targets of one scene are
similar, so the interval is too narrow for other scenes. The seed is fixed, so numbers repeat.

Risk-coverage curves say what share of the classes is wrong if only the most confident pixels count, with intervals.
"""

from __future__ import annotations

import math
from collections.abc import Collection, Iterable, Mapping, Sequence
from dataclasses import dataclass
from itertools import pairwise
from typing import Literal, final

import numpy as np
from scipy.stats import bootstrap, t

from semgs.evaluation.scoring.frame_scores import FrameScores
from semgs.evaluation.scoring.summary import MetricGroup, Values, group_confidences, group_metrics
from semgs.objectives.selective import least_confidence, risks

LEVEL = 0.95
RESAMPLES = 5000
FEWEST_SCENES = 5
SEED = 0
_BATCH = 500
"""Resamples processed at a time; limits the memory for matrices of many classes."""

Over = Literal["scenes", "frames"]

Trainings = Sequence[Sequence[FrameScores]]
"""The scores of one kind of training [seed target]."""

COVERAGES = tuple(step / 20 for step in range(1, 21))
"""The shares of the pixels at which a curve is computed."""


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
    return units_of({frame.scene for frame in frames})


def units_of(scenes: Collection[str]) -> Over:
    """What is resampled of targets in these scenes, each named once."""
    return "scenes" if len(scenes) >= FEWEST_SCENES else "frames"


def units_in_words(units: Iterable[str]) -> str:
    """What was resampled for the intervals of a table, for its note.

    Args:
        units: of each of its rows.
    """
    few, found = f"fewer than {FEWEST_SCENES} scenes", set(units)
    if found == {"scenes"}:
        return "scenes"
    return f"frames, as there are {few}" if found == {"frames"} else f"scenes, or over frames where there are {few}"


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
    return seed_differences([[first], [second]])[0]


def seed_differences(rows: Sequence[Trainings]) -> list[dict[str, Interval]]:
    """Each kind of training minus the one before it, as the mean over seeds, for every metric that all trainings have.

    The interval says what other scenes and other seeds might have given: the distances of its ends are the root of the squares of two 95 %
    intervals. One resamples scenes (or frames) in all trainings alike. The other is Student's, from what is left of the metric once each
    row's and each seed's mean are taken out: a randomised block design, whose variance all rows share, as a few seeds of two rows alone
    say little about it. For two rows it is Student's paired interval. With one seed, there is only the first.

    Args:
        rows: kinds of training [row seed target], each of which adds something to the one before; all with the same seeds and targets, in
            the same order.

    Returns:
        The differences by metric [row - 1].

    Raises:
        ValueError: there are fewer than two rows, a row has other seeds, or the targets differ.
    """
    if len(rows) < 2 or not rows[0]:
        raise ValueError("there are no trainings to compare; expected two rows or more, each of one seed or more")
    if any(len(row) != len(rows[0]) for row in rows):
        raise ValueError(f"the rows have {', '.join(str(len(row)) for row in rows)} seeds; expected the same in each")
    targets = [[(one.scene, one.target) for one in frames] for row in rows for frames in row]
    if any(other != targets[0] for other in targets):
        raise ValueError("the scores are of different targets; expected the same targets in the same order")
    over = choose_units(rows[0][0])
    groups = [[{group.names: group for group in group_metrics(frames)} for frames in row] for row in rows]
    found: list[dict[str, Interval]] = [{} for _ in rows[1:]]
    for names, first in groups[0][0].items():
        alike = [[seed[names] for seed in row if names in seed] for row in groups]
        scene_of = [one.scene_of for row in alike for one in row]
        if len(scene_of) == len(targets) and all(np.array_equal(first.scene_of, one) for one in scene_of):
            halves = _over_seeds(alike)
            for differences, (before, after) in zip(found, pairwise(alike), strict=True):
                differences |= _group_differences(before, after, over, halves)
    return found


def _over_seeds(rows: Sequence[Sequence[MetricGroup]]) -> dict[str, float]:
    """Half of the interval over seeds of the difference of two rows [row seed], by metric; empty for one seed."""
    seeds, freedom = len(rows[0]), (len(rows) - 1) * (len(rows[0]) - 1)
    if not freedom:
        return {}
    once = [[group.once() for group in row] for row in rows]
    halves = {}
    for name in once[0][0]:
        values = np.array([[seed[name] for seed in row] for row in once])
        left = values - values.mean(1, keepdims=True) - values.mean(0) + values.mean()
        halves[name] = float(t.ppf((1 + LEVEL) / 2, freedom)) * math.sqrt(2 * (left**2).sum() / freedom / seeds)
    return halves


def _group_differences(
    before: Sequence[MetricGroup], after: Sequence[MetricGroup], over: Over, halves: Mapping[str, float]
) -> dict[str, Interval]:
    """The differences of a group of metrics, which has one entry in `before` and one in `after` for each seed.

    Args:
        before, after: the rows.
        over: what is resampled.
        halves: half of the interval over seeds, by metric.
    """

    def values(times: np.ndarray, scene_times: np.ndarray) -> np.ndarray:
        pairs = zip(before, after, strict=True)
        return np.mean([b.values(times, scene_times) - a.values(times, scene_times) for a, b in pairs], axis=0)

    return {
        name: _widened(one, halves.get(name, 0.0)) for name, one in group_intervals(before[0], over, values).items()
    }


def _widened(one: Interval, half: float) -> Interval:
    """An interval together with an independent one of the same number, half of which is given."""
    low, high = math.hypot(one.value - one.low, half), math.hypot(one.high - one.value, half)
    return Interval(one.value, one.value - low, one.value + high)


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
