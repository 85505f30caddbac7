"""Voxels: Gaussians that are nearly in the same place become one."""

from __future__ import annotations

import torch
from jaxtyping import Float, Int64
from torch import Tensor

from semgs.geometry.fusion import LEAST
from semgs.geometry.gaussians import Appearance, Gaussians
from semgs.geometry.rotations import covariance, quaternion_from_matrix

LARGEST_CELL = 2**20
"""Voxels are numbered within this many of the origin along each axis, so that a key fits into 63 bits."""

MOST_OPAQUE = 0.99
"""Opacity of joined Gaussians, at most."""


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


def join_in_voxels(
    gaussians: Gaussians, places: Int64[Tensor, " g"], size: float
) -> tuple[Gaussians, Int64[Tensor, " _"]]:
    """The Gaussians with those of one voxel joined.

    The one that takes their place has the mean and the covariance of their mixture, weighted by opacity times area; its colour is the weighted mean and its
    classes the mean of the log probabilities. Its opacity keeps the sum of opacity times area. It gets the place of the heaviest one.

    Args:
        gaussians: of one scene.
        places: of the Gaussians.
        size: length of the sides of voxels [m].

    Raises:
        ValueError: as `voxel_keys`.
    """
    _, voxel, counts = torch.unique(voxel_keys(gaussians.means, size), return_inverse=True, return_counts=True)
    several = counts[voxel] > 1
    if not several.any():
        return gaussians, places
    alone = ~several
    _, voxel = torch.unique(voxel[several], return_inverse=True)
    parts = gaussians.map(lambda tensor: tensor[several])
    weight = (parts.opacities * area(parts.colour.scales)).clamp(min=1e-12)
    order = weight.argsort(stable=True)
    order = order[voxel[order].argsort(stable=True)]  # by voxel, and there by weight
    heaviest = order[voxel.bincount().cumsum(0) - 1]  # the last one of each voxel
    total = weight.new_zeros(len(heaviest)).index_add_(0, voxel, weight)

    def mean(values: Tensor) -> Tensor:
        """The weighted mean over each voxel."""
        weighed = values * weight.reshape(-1, *[1] * (values.ndim - 1))
        summed = values.new_zeros((len(heaviest), *values.shape[1:])).index_add_(0, voxel, weighed)
        return summed / total.reshape(-1, *[1] * (values.ndim - 1))

    means = mean(parts.means)
    offsets = parts.means - means[voxel]

    def joint(shape: Appearance, features: Tensor) -> Appearance:
        """One branch, with the covariance of the mixture."""
        found = mean(covariance(shape.quaternions, shape.scales) + offsets[:, :, None] * offsets[:, None])
        variances, axes = torch.linalg.eigh(found)
        axes = torch.cat((axes[..., :2], torch.linalg.cross(axes[..., 0], axes[..., 1])[..., None]), -1)
        return Appearance(quaternion_from_matrix(axes), variances.clamp(min=1e-12).sqrt(), features)

    colour, semantic = joint(parts.colour, mean(parts.colour.features)), None
    if parts.semantic is not None:
        semantic = joint(parts.semantic, mean((parts.semantic.features + LEAST).log()).softmax(-1))
    opacities = (total / area(colour.scales)).clamp(max=MOST_OPAQUE)
    found = Gaussians(means, opacities, colour, semantic)
    rows = iter([torch.cat((one[alone], other)) for one, other in _pairs(gaussians, found)])
    return gaussians.map(lambda _: next(rows)), torch.cat((places[alone], places[several][heaviest]))


def area(scales: Float[Tensor, "g 3"]) -> Float[Tensor, " g"]:
    """The product of the two largest standard deviations: how much of a surface a Gaussian covers [m^2]."""
    largest = scales.topk(2, -1).values
    return largest.prod(-1)


def _pairs(one: Gaussians, other: Gaussians) -> list[tuple[Tensor, Tensor]]:
    """Each tensor of both."""
    return list(zip(one.tensors().values(), other.tensors().values(), strict=True))
