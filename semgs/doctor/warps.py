"""Measured depth of one frame seen from the next: tests cameras where images have too little texture to match."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise
from typing import final

import numpy as np
from jaxtyping import Float32, Float64

from semgs.data.scene import Scene
from semgs.doctor.rig import Rig, inverse, undistorted_from_pinhole

GRID = (15, 20)
"""Points of each depth map: rows and columns."""

MOST_FRAMES = 12
"""This many frames are used, neighbours in the file's order."""

LEAST_INSIDE = 0.2
"""If less of what one frame measured lands inside the next, the two do not overlap under these cameras."""

CAP_PERCENT = 20.0
"""Pairs that disagree by more, or do not overlap, count as this."""


@final
@dataclass(frozen=True, eq=False)
class DepthView:
    """The measured depth of one frame.

    Attributes:
        frame: its position in the scene.
        points: pixel positions of a grid, as in `Matches`, and z-depth there [g 3] (px, px, m).
        depths: the depth map, 0 where unknown [m].
        map_from_pixel: takes pixel positions (x, y, 1), as in `Matches`, to those of the depth map.
    """

    frame: int
    points: Float64[np.ndarray, "g 3"]
    depths: Float32[np.ndarray, "h w"]
    map_from_pixel: Float64[np.ndarray, "3 3"]


def find_depth_views(scene: Scene, frames: Sequence[int] | None = None) -> tuple[DepthView, ...]:
    """The measured depth of some frames; frames without any are left out.

    Raises:
        InputError: a depth map cannot be read.
    """
    chosen = range(min(len(scene), MOST_FRAMES)) if frames is None else frames
    found = [_depth_view(scene, index) for index in chosen]
    return tuple(one for one in found if one is not None)


def _depth_view(scene: Scene, index: int) -> DepthView | None:
    """The measured depth of one frame, None if nothing was measured on the grid."""
    frame = scene.frames[index]
    depths = frame.measured()
    if depths is None:
        return None
    row, column = (
        ((2 * np.arange(count) + 1) * side // (2 * count)) for count, side in zip(GRID, depths.shape, strict=True)
    )
    z = depths[row[:, None], column].ravel().astype(np.float64)
    x, y = (places.ravel() + 0.5 for places in np.meshgrid(column, row))
    map_from_pixel = undistorted_from_pinhole(frame.lens)
    pixels = np.column_stack((x, y, np.ones_like(x))) @ np.linalg.inv(map_from_pixel).T
    known = z > 0
    if not known.any():
        return None
    return DepthView(index, np.column_stack((pixels[known, :2], z[known])), depths, map_from_pixel)


def warp_error(rig: Rig, views: Sequence[DepthView]) -> float:
    """The mean over neighbouring frames, both ways, of the median disagreement of depth [%], at most `CAP_PERCENT`.

    A point that one frame measured is at some depth in the other frame, which measured its own there. Infinite if more than half of the pairs
    have no poses.
    """
    each = warp_errors(rig, views)
    known = each[np.isfinite(each)]
    return float(known.mean()) if len(known) and 2 * len(known) >= len(each) else np.inf


def warp_errors(rig: Rig, views: Sequence[DepthView]) -> Float64[np.ndarray, " p"]:
    """The median disagreement of each pair of neighbouring frames, both ways [%], at most `CAP_PERCENT`; NaN without poses."""
    pairs = [pair for first, second in pairwise(views) for pair in ((first, second), (second, first))]
    return np.array([_disagreement(rig, *pair) for pair in pairs], dtype=np.float64)


def _disagreement(rig: Rig, first: DepthView, second: DepthView) -> float:
    """The median disagreement of what both measured [%]; NaN if a frame has no pose."""
    i, j = first.frame, second.frame
    motion = (inverse(rig.poses[j : j + 1]) @ rig.poses[i : i + 1])[0]
    if not np.isfinite(motion).all():
        return np.nan
    rays = (first.points[:, :2] - rig.centre[i]) / rig.focal[i]
    depths = rig.z_depths(first.points[:, 2], rays, i)
    there = depths[:, None] * np.column_stack((rays, np.ones(len(rays)))) @ motion[:3, :3].T + motion[:3, 3]
    there = there[there[:, 2] > 0]
    rays = there[:, :2] / there[:, 2:]
    pixels = rays * rig.focal[j] + rig.centre[j]
    column, row, _ = np.floor(np.column_stack((pixels, np.ones(len(pixels)))) @ second.map_from_pixel.T).T
    height, width = second.depths.shape
    inside = (column >= 0) & (column < width) & (row >= 0) & (row < height)
    if inside.sum() < LEAST_INSIDE * len(first.points):
        return CAP_PERCENT
    met = second.depths[row[inside].astype(np.int64), column[inside].astype(np.int64)].astype(np.float64)
    met = rig.z_depths(met, rays[inside], j)
    expected = there[inside, 2]
    known = met > 0
    return (
        min(CAP_PERCENT, 100 * float(np.median(np.abs(expected[known] / met[known] - 1))))
        if known.any()
        else CAP_PERCENT
    )
