"""Numbers that last: a thing keeps its number while the map around it grows, is corrected, or is made anew.

A thing continues the earlier one that it shares Gaussians with. A Gaussian is known by the pixel that it stands for, wherever merging moved it and whatever its class became.
Things that share none are compared by the voxels that they fill, because a map that was forgotten and made anew has other Gaussians. Each time, the pairs with the largest sum of IoUs
continue one another (assignment: Kuhn, Naval Research Logistics 1955). So if two things become one, the number of the larger one stays, and if a thing falls apart, the larger piece keeps it.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from jaxtyping import Int64
from scipy.optimize import linear_sum_assignment
from scipy.sparse import csr_array
from torch import Tensor

from semgs.files.errors import check_type
from semgs.geometry.gaussians import Gaussians
from semgs.robotics.objects import Objects

SIDE = 0.4
"""Of the voxels [m]."""

LEAST = 0.25
"""A thing continues another only if they share at least this part of the smaller one."""

Parts = Int64[np.ndarray, "_ 2"]
"""The number of a thing, and that of one of its Gaussians or voxels, in each row."""


class Ids:
    """Gives things numbers that last. A new thing gets a number that none had before::

        ids = semgs.Ids()
        for scene in semgs.stream(frames):
            found = ids.update(semgs.objects(scene.gaussians), scene.gaussians, scene.sources)

    Things that are not found any more are remembered, and get their numbers back when they are found again.

    Attributes:
        last: the highest number so far.
    """

    def __init__(self) -> None:
        self.last = 0
        self._sources: Parts = np.zeros((0, 2), np.int64)
        self._voxels: Parts = np.zeros((0, 2), np.int64)

    def update(self, found: Objects, gaussians: Gaussians, sources: Int64[Tensor, " g"] | None = None) -> Objects:
        """The same things with numbers that last, in the order of these.

        Args:
            found: the things of the map as it is now.
            gaussians: of the map, in the same frame each time [m].
            sources: a number for each Gaussian that lasts, such as `scene.sources` of a stream; None compares things by voxels alone.

        Raises:
            ValueError: the things or the sources are those of another map.
        """
        check_type("things are", found, Objects, "what semgs.objects returns")
        Gaussians.check_type(gaussians)
        for name, of in (("things", found.instances), ("sources", sources)):
            if of is not None and len(of) != len(gaussians):
                raise ValueError(
                    f"the {name} are of {len(of)} Gaussians; expected those of this map, of {len(gaussians)}"
                )
        inside = np.flatnonzero(found.instances)
        owners = found.instances[inside]
        cells = np.floor(gaussians.means.detach().cpu().double().numpy()[inside] / SIDE).astype(np.int64)
        voxels = np.unique(np.stack((owners, cells @ (1 << 42, 1 << 21, 1)), 1), axis=0)
        known = np.zeros(0, np.int64) if sources is None else sources.detach().cpu().numpy()
        shared = voxels[:0] if sources is None else np.stack((owners, known[inside]), 1)
        numbers = np.zeros(found.instances.max(initial=0) + 1, np.int64)
        for before, now in ((self._sources, shared), (self._voxels, voxels)):
            free = before[~np.isin(before[:, 0], numbers)]
            for number, instance in _continued(free, now[numbers[now[:, 0]] == 0]):
                numbers[instance] = number
        for thing in found.things:
            if numbers[thing.instance] == 0:
                self.last += 1
                numbers[thing.instance] = self.last
        self._sources = _remembered(self._sources[np.isin(self._sources[:, 1], known)], shared, numbers)
        self._voxels = _remembered(self._voxels, voxels, numbers)
        things = [replace(thing, instance=int(numbers[thing.instance])) for thing in found.things]
        return replace(
            found, things=tuple(sorted(things, key=lambda one: one.instance)), instances=numbers[found.instances]
        )


def _continued(before: Parts, now: Parts) -> list[tuple[int, int]]:
    """The pairs of things, before and now, of which one continues the other."""
    _, parts = np.unique(np.concatenate((before[:, 1], now[:, 1])), return_inverse=True)
    (old, first), (new, second) = (np.unique(one[:, 0], return_inverse=True) for one in (before, now))
    one, other = (
        csr_array((np.ones(len(rows)), (rows, columns)), (len(names), parts.max(initial=0) + 1))
        for names, rows, columns in ((old, first, parts[: len(before)]), (new, second, parts[len(before) :]))
    )
    common = (one @ other.T).toarray()
    mine, theirs = one.sum(1)[:, None], other.sum(1)
    ious = np.where(common >= LEAST * np.minimum(mine, theirs), common / (mine + theirs - common), 0)
    pairs = zip(*linear_sum_assignment(ious, maximize=True), strict=True)
    return [(int(old[row]), int(new[column])) for row, column in pairs if ious[row, column] > 0]


def _remembered(before: Parts, now: Parts, numbers: Int64[np.ndarray, " n"]) -> Parts:
    """What things consist of: those of now, by their lasting numbers, and those that were found before only."""
    return np.concatenate((before[~np.isin(before[:, 0], numbers)], np.stack((numbers[now[:, 0]], now[:, 1]), 1)))
