"""Voxels: Gaussians that are nearly in the same place become one."""

from __future__ import annotations

import torch
from jaxtyping import Float, Int64
from torch import Tensor

from semgs.geometry.fusion import LEAST
from semgs.geometry.gaussians import Appearance, Gaussians
from semgs.geometry.rotations import covariance, quaternion_from_matrix

MOST_CELLS = 2**21
"""Voxels along each axis, so that a key fits into 63 bits."""

MOST_OPAQUE = 0.99
"""Opacity of joined Gaussians, at most."""


def voxel_keys(means: Float[Tensor, "g 3"], size: float) -> Int64[Tensor, " g"]:
    """One number for each voxel, counted from the lowest one; equal for points of the same voxel only.

    Raises:
        ValueError: the size is not positive, or less than two steps of the numbers that the points have, or they extend over more than `MOST_CELLS` voxels.
    """
    if not size > 0:
        raise ValueError(f"the size of voxels is {size}; expected a positive length")
    cells = (means.double() / size).floor().long()
    if len(cells):
        away = float(means.abs().max())
        if (step := torch.finfo(means.dtype).eps * away) > size / 2:
            raise ValueError(
                f"positions {away:.4g} from the origin have steps of {step:.2g}, too coarse for voxels of {size}; give poses relative to a point near the scene"
            )
        cells -= cells.amin(0)
        if (most := int(cells.max())) >= MOST_CELLS:
            raise ValueError(f"voxels of {size} are too small for a scene that extends over {most * size:.4g}")
    x, y, z = cells.unbind(-1)
    return (x << 42) + (y << 21) + z


def join_in_voxels(
    gaussians: Gaussians, places: Int64[Tensor, " g"], size: float
) -> tuple[Gaussians, Int64[Tensor, " _"]]:
    """The Gaussians with those of one voxel joined.

    The one that takes their place has the mean and the covariance of their mixture, weighted by opacity times area; its colour is the weighted mean and its
    classes the mean of the log probabilities. Its opacity keeps the sum of opacity times area. It gets the smallest footprint, and the place of the heaviest one.

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

    base = parts.means[heaviest]  # relative to it, float32 is exact far from the origin too
    offsets = parts.means - base[voxel]
    middle = mean(offsets)
    means, offsets = base + middle, offsets - middle[voxel]

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
    footprints = None
    if parts.footprints is not None:  # the sharpest photo says how far details are apart
        footprints = weight.new_full((len(heaviest),), torch.inf).scatter_reduce_(0, voxel, parts.footprints, "amin")
    found = Gaussians(means, opacities, colour, semantic, footprints)
    rows = iter([torch.cat((one[alone], other)) for one, other in _pairs(gaussians, found)])
    return gaussians.map(lambda _: next(rows)), torch.cat((places[alone], places[several][heaviest]))


def area(scales: Float[Tensor, "g 3"]) -> Float[Tensor, " g"]:
    """The product of the two largest standard deviations: how much of a surface a Gaussian covers [m^2]."""
    largest = scales.topk(2, -1).values
    return largest.prod(-1)


def _pairs(one: Gaussians, other: Gaussians) -> list[tuple[Tensor, Tensor]]:
    """Each tensor of both."""
    return list(zip(one.tensors().values(), other.tensors().values(), strict=True))
