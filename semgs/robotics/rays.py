"""Rays from the cameras of the input views to what they saw."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import torch
from jaxtyping import Float, Float64
from torch import Tensor

from semgs.geometry.cameras import Cameras, back_project
from semgs.geometry.gaussians import Gaussians
from semgs.rendering.render import render
from semgs.rendering.rendering import SEEN_ALPHA
from semgs.scene.encoding import block_size, per_gaussian

SPREADS = 1.0
"""Rays stop this many standard deviations before their end."""


@dataclass(frozen=True)
class SightRays:
    """What the cameras of the input views saw, in the level frame.

    Attributes:
        origins: where each ray starts [m].
        ends: where it stops [m].
        spread: standard deviation of the logarithm of its length.
    """

    origins: Float64[np.ndarray, "r 3"]
    ends: Float64[np.ndarray, "r 3"]
    spread: Float64[np.ndarray, " r"]


def rays_of(
    gaussians: Gaussians,
    cameras: Cameras,
    level: Float64[np.ndarray, "3 3"],
    depths: Float[Tensor, "v h w"] | None,
    depth_spread: Float[Tensor, "v h w"] | None,
) -> SightRays:
    """From each camera to its own Gaussians, or, if Gaussians do not belong to pixels, to the points at the given or rendered depths."""
    (views,), count = cameras.batch, len(gaussians)
    spread = torch.zeros(views, *cameras.size) if depth_spread is None else depth_spread
    stride = block_size(count, views, *cameras.size)
    if not stride:
        if depths is None:
            depths = _rendered_depths(gaussians, cameras)
        ends = back_project(depths.double(), cameras)
        known = depths > 0
        origins = cameras.centres[:, None, None].expand(ends.shape)[known]
        ends, spread = ends[known], spread[known]
    else:
        ends = gaussians.means.detach().double()
        origins = cameras.centres.repeat_interleave(count // views, 0)
        spread = per_gaussian(spread[:, None], stride)[:, 0]
    found = (one.cpu().double().numpy() for one in (origins, ends))
    origins, ends = (one @ level.T for one in found)
    return SightRays(origins, ends, spread.cpu().double().numpy())


def _rendered_depths(gaussians: Gaussians, cameras: Cameras) -> Float[Tensor, "v h w"]:
    """The depth that each camera sees, 0 where it sees little."""
    with torch.no_grad():
        views = [render(gaussians, cameras[index : index + 1]) for index in range(cameras.batch[0])]
    return torch.cat([torch.where(view.alphas >= SEEN_ALPHA, view.depths, 0) for view in views])


def free_parts(
    rays: SightRays, reach: float, origin: Float64[np.ndarray, " 3"], resolution: float
) -> tuple[Float64[np.ndarray, "r 3"], Float64[np.ndarray, "r 3"]]:
    """Both ends of the parts of rays that are free, in voxels: up to `reach`, and to a voxel before their end or to where their depth is uncertain."""
    along = rays.ends - rays.origins
    lengths = np.linalg.norm(along, axis=-1)
    free = np.minimum(lengths * np.exp(-SPREADS * rays.spread), lengths - resolution).clip(0, reach)
    stops = rays.origins + along * (free / lengths.clip(min=1e-9))[:, None]
    return (rays.origins - origin) / resolution, (stops - origin) / resolution
