"""Voxels that rays pass through."""

from __future__ import annotations

import numpy as np
from jaxtyping import Float64, Int64

TOGETHER = 8192
"""Rays that are followed at once."""


def passes(
    origins: Float64[np.ndarray, "r 3"], ends: Float64[np.ndarray, "r 3"], shape: tuple[int, int, int]
) -> Int64[np.ndarray, "x y z"]:
    """How many rays pass through each voxel, the voxels of both ends included.

    All rays of a block take one step at a time into the neighbour behind the side that they leave through (Amanatides and Woo, "A fast voxel traversal algorithm for ray
    tracing", Eurographics 1987).

    Args:
        origins, ends: in units of voxels from the corner of the grid; parts outside of the grid are left out.
        shape: of the grid.
    """
    counts = np.zeros(int(np.prod(shape)), np.int64)
    for start in range(0, len(origins), TOGETHER):
        block = slice(start, start + TOGETHER)
        counts += np.bincount(_visited(origins[block], ends[block], shape), minlength=len(counts))
    return counts.reshape(shape)


def _visited(
    origins: Float64[np.ndarray, "r 3"], ends: Float64[np.ndarray, "r 3"], shape: tuple[int, int, int]
) -> Int64[np.ndarray, " n"]:
    """The voxels on each ray, one after the other, as positions in the flat grid."""
    along = ends - origins
    with np.errstate(divide="ignore", invalid="ignore"):
        sides = np.stack((-origins, np.array(shape) - origins)) / along
    # Along an axis on which a ray stands still it is always inside, or never.
    still = np.where((origins >= 0) & (origins < shape), np.inf, -np.inf)
    enters = np.where(along == 0, -still, sides.min(0)).max(1).clip(min=0)
    leaves = np.where(along == 0, still, sides.max(0)).min(1).clip(max=1)
    inside = enters < leaves
    origins, along, enters, leaves = (array[inside] for array in (origins, along, enters, leaves))
    cells = np.floor(origins + enters[:, None] * along).astype(np.int64).clip(0, np.array(shape) - 1)
    steps = np.sign(along).astype(np.int64)
    strides = np.array([shape[1] * shape[2], shape[2], 1])
    found = []
    while len(cells):
        found.append(cells @ strides)
        with np.errstate(divide="ignore", invalid="ignore"):
            crossings = np.where(along == 0, np.inf, (cells + (steps > 0) - origins) / along)
        axis = crossings.argmin(1)
        rows = np.arange(len(cells))
        cells[rows, axis] += steps[rows, axis]
        going = (crossings[rows, axis] < leaves) & (cells >= 0).all(1) & (cells < shape).all(1)
        cells, steps, origins, along, leaves = (array[going] for array in (cells, steps, origins, along, leaves))
    return np.concatenate(found) if found else np.zeros(0, np.int64)
