"""Upright boxes: turned about gravity only."""

from __future__ import annotations

from dataclasses import dataclass, replace

import cv2
import numpy as np
from jaxtyping import Float64

from semgs.robotics.object_libraries import box_library

INNER = (2.0, 98.0)
"""Percentiles between which the sides of a box lie: a few points with wrong depth would make it much larger."""

CLOSE = 1e-9
"""Points on a percentile are inside, whatever rounding does [m]."""

FLAT = 1e-6
"""Points whose plan is narrower than this share of its length are on a line."""


SIGNS = np.array([[1.0 if index >> axis & 1 else -1.0 for axis in range(3)] for index in range(8)])
"""The side on which each corner of a box is: bit 0 of its index along the length, bit 1 along the width, bit 2 along the height."""

EDGES = tuple((index, index | 1 << axis) for axis in range(3) for index in range(8) if not index >> axis & 1)
"""The pairs of corners that are joined by an edge."""


@dataclass(frozen=True)
class Box:
    """A box that stands upright.

    Attributes:
        centre: [m].
        size: length, width and height; length >= width [m].
        yaw: from the x axis to the length of the box, anticlockwise seen from above, -pi/2 to pi/2 [rad].
    """

    centre: tuple[float, float, float]
    size: tuple[float, float, float]
    yaw: float

    @property
    def axes(self) -> Float64[np.ndarray, "3 3"]:
        """The directions of length, width and height, in columns."""
        cosine, sine = np.cos(self.yaw), np.sin(self.yaw)
        return np.array([[cosine, -sine, 0.0], [sine, cosine, 0.0], [0.0, 0.0, 1.0]])

    @property
    def corners(self) -> Float64[np.ndarray, "8 3"]:
        """The corners, in the order of `SIGNS` [m]."""
        return SIGNS * np.array(self.size) / 2 @ self.axes.T + self.centre

    @property
    def bottom(self) -> float:
        """The height of the lower side [m]."""
        return self.centre[2] - self.size[2] / 2

    def distance(self, point: Float64[np.ndarray, " 3"]) -> float:
        """From a point to the nearest point of the box; 0 inside [m]."""
        inside = np.abs((point - self.centre) @ self.axes) - np.array(self.size) / 2
        return float(np.linalg.norm(inside.clip(min=0)))

    def thickened(self, least: float) -> Box:
        """The box with no side shorter than this [m]."""
        length, width, height = (max(side, least) for side in self.size)
        return replace(self, size=(length, width, height))

    def iou(self, other: Box) -> float:
        """The volume that two boxes share, relative to that of both together; 0 if neither has any."""
        mine, theirs = (box.corners[[0, 1, 3, 2], :2].astype(np.float32) for box in (self, other))
        area, _ = cv2.intersectConvexConvex(mine, theirs)
        tops = min(box.centre[2] + box.size[2] / 2 for box in (self, other))
        bottoms = max(self.bottom, other.bottom)
        shared = area * max(tops - bottoms, 0.0)
        together = sum(float(np.prod(box.size)) for box in (self, other)) - shared
        return shared / together if together > 0 else 0.0


def box_of(points: Float64[np.ndarray, "n 3"]) -> Box:
    """The box of some points: the smallest rectangle around their plan, between percentiles of their heights.

    Points outside of the percentiles `INNER` along either side of a first rectangle are left out of the plan.

    Args:
        points: with z up [m]; at least one.

    Raises:
        ImportError: trimesh is not installed.
    """
    low, high = np.percentile(points[:, 2], INNER)
    first = _rectangle(points[:, :2])
    local = points[:, :2] @ np.array([[np.cos(first.yaw), -np.sin(first.yaw)], [np.sin(first.yaw), np.cos(first.yaw)]])
    least, most = np.percentile(local, INNER, axis=0)
    inner = ((local >= least - CLOSE) & (local <= most + CLOSE)).all(1)
    plan = _rectangle(points[inner, :2]) if inner.any() else first
    yaw = (plan.yaw + np.pi / 2) % np.pi - np.pi / 2
    return Box((plan.x, plan.y, float(low + high) / 2), (plan.length, plan.width, float(high - low)), float(yaw))


@dataclass(frozen=True)
class Rectangle:
    """A rectangle in the plan: its middle, sides and yaw [m, rad]."""

    x: float
    y: float
    length: float
    width: float
    yaw: float


def _rectangle(plan: Float64[np.ndarray, "n 2"]) -> Rectangle:
    """The smallest rectangle around points."""
    middle = plan.mean(0)
    _, extents, directions = np.linalg.svd(plan - middle, full_matrices=False)
    if len(plan) < 3 or extents[-1] <= FLAT * extents[0]:  # no hull: a point or a line
        along = (plan - middle) @ directions[0]
        x, y = middle + directions[0] * (along.min() + along.max()) / 2
        return Rectangle(float(x), float(y), float(np.ptp(along)), 0.0, float(np.arctan2(*directions[0, ::-1])))
    box_from_plan, (length, width) = box_library().oriented_bounds_2D(plan)
    turn = box_from_plan[:2, :2]
    x, y = -turn.T @ box_from_plan[:2, 2]
    return Rectangle(float(x), float(y), float(length), float(width), float(np.arctan2(turn[0, 1], turn[0, 0])))
