"""Schedule of single images: which scene each shows, so that all scenes of a folder come equally often and none comes twice in a batch."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

GOLDEN = (5**0.5 - 1) / 2
"""Multiples of it modulo 1 fill the unit interval evenly, however many there are (golden ratio)."""


@dataclass(frozen=True)
class Turn:
    """One sample.

    Attributes:
        source: the number of its source.
        scene: the number of its scene in that source.
        round: how many turns that scene has had before.
    """

    source: int
    scene: int
    round: int


class ImageSchedule:
    """Whose turn k is; it depends on the seed and k alone. Sources come in proportion to their weights, the scenes of each in rounds.

    In every round each scene of a source comes once, in a new order. Between two turns of a scene there are at least `gap` - 1 turns of
    other scenes of its source, or turns of all others if there are fewer.

    Args:
        seed: of every order.
        weights: of the sources.
        scenes: how many scenes each source has; 0 for an endless source, whose scenes are numbered by k.
        gap: scenes per step.
        length: how many turns there are.
    """

    def __init__(self, seed: int, weights: Sequence[float], scenes: Sequence[int], gap: int, length: int) -> None:
        self._seed, self._scenes, self._gap = seed, tuple(scenes), gap
        start = float(self._generator(0, 0).random())
        places = (start + GOLDEN * np.arange(length)) % 1
        ends = np.cumsum(np.array(weights, dtype=np.float64) / sum(weights))[:-1]
        self._sources = np.searchsorted(ends, places, side="right").astype(np.int32)
        self._earlier = np.zeros(length, dtype=np.int64)  # turns of the same source before this one
        for source in range(len(self._scenes)):
            own = self._sources == source
            self._earlier[own] = np.arange(own.sum())
        self._orders: dict[int, list[list[int]]] = {source: [] for source in range(len(self._scenes))}

    def __getitem__(self, k: int) -> Turn:
        """Turn k."""
        source, earlier = int(self._sources[k]), int(self._earlier[k])
        if not self._scenes[source]:
            return Turn(source, k, 0)
        done, place = divmod(earlier, self._scenes[source])
        return Turn(source, self._order(source, done)[place], done)

    def _order(self, source: int, number: int) -> list[int]:
        """The scenes of a source in the order of a round."""
        orders, count = self._orders[source], self._scenes[source]
        while len(orders) <= number:
            shuffled = self._generator(source + 1, len(orders)).permutation(count).tolist()
            orders.append(_keep_apart(orders[-1] if orders else [], shuffled, min(self._gap, count)))
        return orders[number]

    def _generator(self, *which: int) -> np.random.Generator:
        return np.random.Generator(np.random.PCG64(np.random.SeedSequence((self._seed, 7, *which))))


def frame_of(seed: int, turn: Turn, frames: int) -> int:
    """Which frame of a scene a turn shows: each frame once before any comes again, in an order of the scene's own."""
    rng = np.random.Generator(np.random.PCG64(np.random.SeedSequence((seed, 8, turn.source, turn.scene))))
    return int(rng.permutation(frames)[turn.round % frames])


def _keep_apart(before: Sequence[int], shuffled: Sequence[int], gap: int) -> list[int]:
    """The shuffled scenes, reordered as little as possible, so that none comes again within `gap` turns of its place in the last round."""
    waiting, order = list(shuffled), []
    for place in range(gap - 1 if before else 0):
        recent = set(before[len(before) - (gap - 1 - place) :])
        order.append(waiting.pop(next(at for at, scene in enumerate(waiting) if scene not in recent)))
    return order + waiting
