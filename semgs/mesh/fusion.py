"""Depth maps fused into a truncated signed distance field, in blocks of voxels around the surface only."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import torch
from jaxtyping import Bool, Float32, Float64, Int64

from semgs.geometry.cameras import Cameras, back_project
from semgs.runtime.kernels import in_threads

SIDE = 8
"""Voxels along each side of a block."""

TRUNCATION = 4.0
"""Distances are known up to this many voxels from the surface."""

AROUND = 2
"""Blocks that are this many voxels from a measured point or nearer belong to the field [voxels]."""

SMOOTH = 1 / 8
"""Where the depth bends by less than this share of a step, a surface continues to both sides."""

MOST_BLOCKS = 150_000
"""Of 4 KB each: more would not fit into the memory of a small machine."""

FARTHEST = 1 << 20
"""Places of blocks are smaller than this along each axis, so that a place fits into one number."""


@dataclass(frozen=True)
class DepthMap:
    """What one camera measures.

    Attributes:
        camera: one, without leading axes.
        depths: z-depth, 0 = unknown [unit of the scene].
        worth: how much each pixel counts, 0 for not at all, as at steps of the depth.
    """

    camera: Cameras
    depths: Float64[np.ndarray, "h w"]
    worth: Float64[np.ndarray, "h w"]


@dataclass(frozen=True)
class Field:
    """A truncated signed distance field; positive in front of the surface.

    Attributes:
        blocks: their places in ascending order; voxel (i, j, k) of a block is at (8 block + (i, j, k)) voxel.
        distances: in units of the truncation, -1 to 1.
        weights: 0 for voxels that no camera observed.
        voxel: side of a voxel [unit of the scene].
    """

    blocks: Int64[np.ndarray, "b 3"]
    distances: Float32[np.ndarray, "b 8 8 8"]
    weights: Float32[np.ndarray, "b 8 8 8"]
    voxel: float


def fuse(maps: Sequence[DepthMap], voxel: float) -> Field:
    """The signed distances of the surfaces that depth maps show, weighted means over all of them.

    Args:
        maps: of one scene.
        voxel: side of a voxel [unit of the scene].

    Raises:
        ValueError: so many blocks of voxels that they would not fit into memory.
    """
    from semgs.mesh.fusion_kernels import integrate  # Numba takes a second to import

    packed = np.zeros(0, np.int64)
    for one in maps:
        packed = np.union1d(packed, _touched(one, voxel))
        if len(packed) > MOST_BLOCKS:
            raise _too_many(voxel)
    blocks = np.stack([(packed >> shift & 2 * FARTHEST - 1) - FARTHEST for shift in (42, 21, 0)], -1)
    sums, weights = np.zeros((2, len(blocks), SIDE, SIDE, SIDE), np.float32)
    for one in maps:
        matrix = one.camera.intrinsics.numpy()
        lens = np.array([matrix[0, 0], matrix[1, 1], matrix[0, 2], matrix[1, 2]])
        planes, flat = planes_of(one.depths, TRUNCATION * voxel)
        in_threads(
            integrate,
            sums,
            weights,
            blocks,
            voxel,
            TRUNCATION * voxel,
            planes,
            np.where(flat, one.worth, 0),
            one.camera.camera_from_world.numpy(),
            lens,
        )
    np.divide(sums, weights, out=sums, where=weights > 0)
    return Field(blocks, sums, weights, voxel)


def planes_of(
    depths: Float64[np.ndarray, "h w"], step: float
) -> tuple[Float64[np.ndarray, "h w 3"], Bool[np.ndarray, "h w"]]:
    """The small plane that each pixel stands for, as `integrate` takes it, and whether there is one: its depth is known, and continues to one side along each axis.

    The inverse depth of a plane is linear in the image, however slanted it is. Where the differences to both sides are alike, their mean counts, and else the smaller one,
    which is that of the pixel's own surface.

    Args:
        depths: z-depth, 0 = unknown [unit of the scene].
        step: where the depth differs by more to both sides, a pixel is on no surface, unless it fits a plane through its neighbours [unit of the scene].
    """
    known = depths > 0
    inverse = np.divide(1, depths, out=np.zeros_like(depths), where=known)
    planes, flat = [inverse], known.copy()
    for axis in (1, 0):
        difference = np.diff(inverse, axis=axis)
        neighbours = np.logical_and(
            *(np.take(known, range(start, known.shape[axis] - 1 + start), axis) for start in (0, 1))
        )
        difference = np.where(neighbours, difference, np.inf)
        ends = [(1, 0) if one == axis else (0, 0) for one in (0, 1)]
        before = np.pad(difference, ends, constant_values=np.inf)
        after = np.pad(difference, [end[::-1] for end in ends], constant_values=np.inf)
        slope = np.where(np.abs(before) < np.abs(after), before, after)
        with np.errstate(invalid="ignore"):
            bend = np.abs(after - before) * depths**2
            slope = np.where(bend <= SMOOTH * step, (before + after) / 2, slope)
            flat &= np.fmin(bend, np.abs(slope) * depths**2) <= step
        planes.append(np.where(np.isfinite(slope), slope, 0))
    return np.stack(planes, -1), flat


def _touched(one: DepthMap, voxel: float) -> Int64[np.ndarray, " n"]:
    """The blocks near to the points that a depth map shows, each place as one number.

    Raises:
        ValueError: places are too large.
    """
    points = back_project(torch.from_numpy(one.depths), one.camera).numpy()[(one.worth > 0) & (one.depths > 0)]
    if np.abs(points).max(initial=0) >= (FARTHEST - 1) * SIDE * voxel:
        raise _too_many(voxel)
    points = np.unique(np.floor(points / voxel).astype(np.int64), axis=0)
    found = []
    for corner in np.ndindex(2, 2, 2):
        places = (points + AROUND * (2 * np.array(corner) - 1)) // SIDE + FARTHEST
        found.append(places[:, 0] << 42 | places[:, 1] << 21 | places[:, 2])
    return np.unique(np.concatenate(found))


def _too_many(voxel: float) -> ValueError:
    return ValueError(
        f"voxels of {voxel:g} are too small for a scene of this size: more than {MOST_BLOCKS * SIDE**3:,} of them are near surfaces; use a larger --voxel"
    )
