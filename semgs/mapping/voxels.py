"""Voxels: Gaussians that are nearly in the same place become one."""

from __future__ import annotations

from dataclasses import replace

import torch
from jaxtyping import Float, Int64
from torch import Tensor

from semgs.geometry.gaussians import Gaussians
from semgs.model.encoding import Places
from semgs.segmenters.fusion import LEAST

LARGEST_CELL = 2**20
"""Voxels are numbered within this many of the origin along each axis, so that a key fits into 63 bits."""


def voxel_keys(means: Float[Tensor, "g 3"], size: float) -> Int64[Tensor, " g"]:
    """One number for each voxel; equal for points of the same voxel only.

    Raises:
        ValueError: the size is not positive, or a point is more than `LARGEST_CELL` voxels from the origin.
    """
    if not size > 0:
        raise ValueError(f"the size of voxels is {size}; expected a positive length")
    cells = (means.double() / size).floor().long()
    if len(cells) and int(cells.abs().max()) >= LARGEST_CELL:
        raise ValueError(f"voxels of {size} are too small for a scene of {float(means.abs().max()):.4g}")
    x, y, z = (cells + LARGEST_CELL).unbind(-1)
    return (x << 42) + (y << 21) + z


def joined_in_voxels(gaussians: Gaussians, places: Places, size: float) -> tuple[Gaussians, Places]:
    """The Gaussians with those of one voxel joined.

    The smallest one stays, with its place and shape. Its position, colour and classes become means, weighted by opacity (of classes: the mean of the log
    probabilities), and its opacity that of all, 1 - prod(1 - opacity).

    Args:
        gaussians: of one scene.
        places: of the Gaussians.
        size: length of the sides of voxels [m].

    Raises:
        ValueError: as `voxel_keys`.
    """
    _, voxel, counts = torch.unique(voxel_keys(gaussians.means, size), return_inverse=True, return_counts=True)
    if len(counts) == len(gaussians):
        return gaussians, places
    order = gaussians.colour.scales.sum(-1).argsort(descending=True, stable=True)
    keeper = torch.empty(len(counts), dtype=torch.int64)
    keeper[voxel[order]] = order  # the last one that is written is the smallest
    weight = gaussians.opacities.clamp(min=1e-6)
    total = torch.zeros(len(counts)).index_add_(0, voxel, weight)

    def mean(values: Tensor) -> Tensor:
        """The weighted mean over each voxel."""
        weighed = values * weight.reshape(-1, *[1] * (values.ndim - 1))
        summed = values.new_zeros((len(counts), *values.shape[1:])).index_add_(0, voxel, weighed)
        return summed / total.reshape(-1, *[1] * (values.ndim - 1))

    clear = torch.zeros(len(counts)).index_add_(0, voxel, (-gaussians.opacities.clamp(max=1 - 1e-6)).log1p())
    kept = gaussians.map(lambda tensor: tensor[keeper])
    semantic = kept.semantic
    if semantic is not None and gaussians.semantic is not None:
        semantic = replace(semantic, features=mean((gaussians.semantic.features + LEAST).log()).softmax(-1))
    return replace(
        kept,
        means=mean(gaussians.means),
        opacities=1 - clear.exp(),
        colour=replace(kept.colour, features=mean(gaussians.colour.features)),
        semantic=semantic,
    ), places[keeper]
