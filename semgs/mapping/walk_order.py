"""The order of a walk, for recordings whose files list the frames in another one."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field

import numpy as np
from jaxtyping import Float64

from semgs.data.spread import spread
from semgs.files.text import natural_order

FEWEST = 6
"""Fewer frames stay in the order of the file."""

SHUFFLED = 0.6
"""Frames are in no order of a walk if the way past them is longer than this share of the way past them in random order."""

COMPARED = 200
"""The way in random order is estimated from so many frames."""


@dataclass(frozen=True)
class WalkOrder:
    """In which order the frames of a recording are taken.

    Attributes:
        positions: of the frames, in that order.
        note: what the user should know; "" if it is the order of the file.
    """

    positions: tuple[int, ...]
    note: str = ""


@dataclass(frozen=True)
class _Way:
    """The ways past cameras in any order.

    Attributes:
        poses: camera to world.
        depth: a typical depth. Turning by an angle moves what is seen as far as walking so far along the arc.
    """

    poses: Float64[np.ndarray, "n 4 4"] = field(repr=False)
    depth: float

    def steps(
        self, here: Float64[np.ndarray, "*m 4 4"], there: Float64[np.ndarray, "n 4 4"]
    ) -> Float64[np.ndarray, " n"]:
        """How far cameras are from one, or each from its own."""
        moved = np.linalg.norm(there[:, :3, 3] - here[..., :3, 3], axis=1)
        traces = (there[:, :3, :3] * here[..., :3, :3]).sum((1, 2))
        return moved + self.depth * np.arccos(np.clip((traces - 1) / 2, -1, 1))

    def steps_from(self, position: int) -> Float64[np.ndarray, " n"]:
        """How far each camera is from one of them."""
        return self.steps(self.poses[position], self.poses)

    def length(self, order: Sequence[int]) -> float:
        """The length of the way in an order."""
        along = self.poses[list(order)]
        return float(self.steps(along[:-1], along[1:]).sum())

    def random_length(self) -> float:
        """The mean length of the way in random order."""
        count = len(self.poses)
        some = spread(range(count), COMPARED)
        return float(np.mean([self.steps_from(one).sum() / (count - 1) for one in some])) * (count - 1)

    def nearest_first(self) -> list[int]:
        """An order that always goes to the nearest of the other cameras, from the one that is farthest from the first in the file."""
        here = int(self.steps_from(0).argmax())
        order, left = [here], np.ones(len(self.poses), dtype=bool)
        left[here] = False
        while left.any():
            here = int(np.where(left, self.steps_from(here), np.inf).argmin())
            left[here] = False
            order.append(here)
        return order


def walk_order(names: Sequence[str], poses: Float64[np.ndarray, "n 4 4"], depth: float) -> WalkOrder:
    """The order of the file if that is a walk; else that of the names, numbers by their value; else from each camera to the nearest of the others.

    Args:
        names: of the frames.
        poses: camera to world.
        depth: a typical depth, in the unit of the poses.
    """
    filed = tuple(range(len(names)))
    way = _Way(poses, depth)
    limit = SHUFFLED * way.random_length() if len(names) >= FEWEST else np.inf
    if way.length(filed) <= limit:
        return WalkOrder(filed)
    said = "The file lists the frames in no order of a walk, so they are taken "
    named = tuple(sorted(filed, key=lambda position: natural_order(names[position])))
    if way.length(named) <= limit:
        return WalkOrder(named, f"{said}in the order of their names.")
    nearest = tuple(way.nearest_first())
    if way.length(nearest) <= limit:
        return WalkOrder(
            nearest, f"{said}along the positions of their cameras, as their names are in no such order either."
        )
    return WalkOrder(filed)
