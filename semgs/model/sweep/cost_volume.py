"""Cost volume: correlation of each view's features with those of the other views, warped for each depth candidate.

A 3D filter compares the cost of a candidate at a texel with its neighbours, in the view and in depth.
The depth U-Net takes candidates as channels, so it has to learn what a surface looks like for each of them. A 3D convolution learns it
once for all (Kendall et al., "End-to-End Learning of Geometry and Context for Deep Stereo Regression", ICCV 2017). Not in the paper.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence

import torch
from jaxtyping import Float
from torch import Tensor, nn
from torch.nn.functional import gelu, interpolate

from semgs.geometry.cameras import Cameras
from semgs.geometry.plane_sweep import sweep
from semgs.model.layers.network_input import by_chunks
from semgs.model.settings import OURS, Conventions
from semgs.runtime.precision import outside_autocast

BEHIND = 1e-3
"""Points closer to a source camera than this fraction of the near bound count as behind it (MVSplat: this many metres)."""

CHUNK = 16
"""Depth candidates that the plain version warps at a time."""


def cost_volume(
    features: Float[Tensor, "b v c h w"],
    cameras: Cameras,
    near: Float[Tensor, "b v"],
    candidates: Float[Tensor, "b v l"],
    conventions: Conventions = OURS,
    *,
    fused: bool | None = None,
    views_at_a_time: int | None = None,
) -> Float[Tensor, "b v l h w"]:
    """C_i: for each view, texel and candidate the mean of <F_i, F_j warped to i> / sqrt(c) over the other views j.

    The mean is over the views that see the point; it is 0 if none does. No gradient flows through the positions.

    Args:
        features: of N >= 2 views.
        cameras: of the views [b v].
        near: near bounds [m].
        candidates: depths of each reference view [m].
        conventions: of geometry; MVSplat's mean is over all other views.
        fused: use the compiled kernel; None uses it on the CPU. The plain version is its specification.
        views_at_a_time: reference views to compute at a time; None is all.
    """
    if fused is None:
        fused = features.device.type == "cpu"

    def of(at: slice) -> Tensor:
        cost = _cost_of(range(*at.indices(features.shape[1])), features, cameras, near, candidates, conventions, fused)
        return cost.transpose(0, 1)

    return by_chunks(of, features.shape[1], views_at_a_time).transpose(0, 1)


def _cost_of(
    views: Sequence[int],
    features: Float[Tensor, "b v c h w"],
    cameras: Cameras,
    near: Float[Tensor, "b v"],
    candidates: Float[Tensor, "b v l"],
    conventions: Conventions,
    fused: bool,
) -> Float[Tensor, "b r l h w"]:
    """The cost of some of the reference views."""
    b, v, c, h, w = features.shape
    smallest = BEHIND * near if conventions.mask_unseen else torch.full_like(near, BEHIND)
    reference = torch.tensor(views).repeat_interleave(v - 1)
    source = torch.tensor([j for i in views for j in range(v) if j != i])
    plan = sweep(
        cameras[:, reference],
        cameras[:, source],
        (h, w),
        own_intrinsics=conventions.own_intrinsics,
        pixel_centres=conventions.pixel_centres,
    )
    # Positions and sums are computed in float32 at least, from relative cameras that were multiplied in float64.
    precise = torch.float64 if features.dtype == torch.float64 else torch.float32
    matrices = plan.matrix.to(features.device, precise).flatten(0, 1)
    offsets = plan.offset.to(features.device, precise).flatten(0, 1)
    depths = candidates[:, reference].to(precise).flatten(0, 1)
    limits = smallest[:, reference].to(features.device, precise).flatten(0, 1)
    correlated: Callable[..., tuple[Tensor, Tensor]] = correlate
    maps = features
    if fused:
        from semgs.model.sweep.correlation import correlate_fused

        correlated, maps = correlate_fused, features.permute(0, 1, 3, 4, 2)
    both = (maps[:, index].flatten(0, 1).to(precise).contiguous() for index in (reference, source))
    sums, seen = correlated(*both, matrices, offsets, depths, limits, conventions.mask_unseen)
    pairs = (b, len(views), v - 1, -1, h, w)
    sums = sums.reshape(pairs).sum(2) / math.sqrt(c)
    if not conventions.mask_unseen:
        return (sums / (v - 1)).to(features.dtype)
    count = seen.reshape(pairs).sum(2)
    return (sums / count.clamp(min=1)).to(features.dtype)


def unit_features(features: Float[Tensor, "n c h w"]) -> Float[Tensor, "n c h w"]:
    """Features minus their mean over each image, scaled to length sqrt(c) at every texel; costs are then sqrt(c) times cosines."""
    centred = features - features.mean((-2, -1), keepdim=True)
    length = centred.square().sum(1, keepdim=True).clamp(min=1e-12).sqrt()
    return centred * (math.sqrt(features.shape[1]) / length)


@outside_autocast
def correlate(
    reference: Float[Tensor, "n c h w"],
    source: Float[Tensor, "n c h w"],
    matrices: Float[Tensor, "n 3 3"],
    offsets: Float[Tensor, "n 3"],
    depths: Float[Tensor, "n l"],
    smallest: Float[Tensor, " n"],
    mask_unseen: bool,
) -> tuple[Float[Tensor, "n l h w"], Float[Tensor, "n l h w"]]:
    """<reference, warped source> of pairs of feature maps at each depth, and 1 where the source sees the point.

    Args:
        reference: features of the reference views, to which the result belongs.
        source: features of the source views, which are sampled bilinearly.
        matrices, offsets: the plane sweep's projective map in texels.
        depths: of each plane [m].
        smallest: depth in the source below which a point is behind it [m].
        mask_unseen: points behind or outside the source view give 0 and are unseen, and border texels extend to the map's edge; else
            depth is clamped to `smallest`, and the map is surrounded by zeros.
    """
    h, w = reference.shape[-2:]
    rows, columns = torch.meshgrid(
        torch.arange(h, device=depths.device, dtype=depths.dtype),
        torch.arange(w, device=depths.device, dtype=depths.dtype),
        indexing="ij",
    )
    texels = torch.stack((columns, rows, torch.ones_like(rows)), dim=-1)
    rays = torch.einsum("nij,hwj->nhwi", matrices, texels)
    limit = smallest[:, None, None, None]
    sums, seen = [], []
    for chunk in torch.split(depths, CHUNK, dim=1):
        points = rays[:, None] * chunk[:, :, None, None, None] + offsets[:, None, None, None]
        z = points[..., 2]
        u, v = (points[..., axis] / z.clamp(min=limit) for axis in (0, 1))
        grid = torch.stack(((2 * u + 1) / w - 1, (2 * v + 1) / h - 1), dim=-1)
        warped = torch.nn.functional.grid_sample(
            source,
            grid.flatten(1, 2),
            mode="bilinear",
            padding_mode="border" if mask_unseen else "zeros",
            align_corners=False,
        )
        warped = torch.unflatten(warped, 2, (-1, h))
        product = (reference[:, :, None] * warped).sum(1)
        visible = (z > limit) & (u >= -0.5) & (u <= w - 0.5) & (v >= -0.5) & (v <= h - 0.5)
        sums.append(product * visible if mask_unseen else product)
        seen.append(visible.to(product.dtype))
    return torch.cat(sums, dim=1), torch.cat(seen, dim=1)


class CostFilter(nn.Module):
    """cost + correction: two 3D convolutions at 1/2 and two at 1/4 of the volume's sides. The correction starts at zero.

    Args:
        channels: at 1/2; twice as many at 1/4.
    """

    def __init__(self, channels: int) -> None:
        super().__init__()
        self.down = nn.Conv3d(1, channels, 3, stride=2, padding=1)
        self.coarse = nn.Conv3d(channels, 2 * channels, 3, stride=2, padding=1)
        self.mixed = nn.Conv3d(2 * channels, 2 * channels, 3, padding=1)
        self.up = nn.Conv3d(2 * channels, channels, 1)
        self.last = nn.Conv3d(channels, 1, 3, padding=1)
        for parameter in self.last.parameters():
            nn.init.zeros_(parameter)

    def forward(self, cost: Float[Tensor, "n l h w"]) -> Float[Tensor, "n l h w"]:
        """The filtered cost."""
        volume = cost[:, None]
        half = self.down(volume)
        coarse = gelu(self.mixed(gelu(self.coarse(gelu(half)))))
        joined = gelu(half + widened_to(self.up(coarse), half))
        correction: Tensor = widened_to(self.last(joined), volume)[:, 0]
        return cost + correction


def widened_to(volume: Float[Tensor, "n c l h w"], like: Tensor) -> Float[Tensor, "n c l2 h2 w2"]:
    """A volume resampled to the size of another; with channels last torch is seven times as fast."""
    volume = volume.contiguous(memory_format=torch.channels_last_3d)
    return interpolate(volume, size=like.shape[-3:], mode="trilinear", align_corners=False)
