"""Losses of depth by plane sweep against true depth. Nothing is rendered, and none is part of the paper.

    L = log L_log + gradients L_grad + distribution L_dist + sharp L_sharp

As in `semgs.objectives.losses`, every term is one number per view, averaged over views and batch. Pixels with unknown true depth (0) do
not count, and a view without any true depth counts as 0.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

import torch
from jaxtyping import Bool, Float
from torch import Tensor
from torch.nn.functional import avg_pool2d, max_pool2d

from semgs.objectives.loss_weights import DepthLossWeights
from semgs.objectives.losses import depth_error, per_known_pixel
from semgs.scene.coarse_depth import SHRINK, CoarseDepth

STRIDES = (1, 2, 4, 8)
"""The scales of gradient matching: steps in pixels between the compared pixels."""

EDGE = 0.1
"""A depth edge is a pixel around which, in 3x3 pixels, log depth differs by more than this."""

NEAR_EDGE = 6
"""A pixel is near an edge if it is at most this many pixels away along each side [px]."""

AT_EDGES = 3.0
"""Weight of the error near edges in L_sharp."""

SMOOTHING = 31
"""Side of the window over which L_sharp averages the error away from edges [px]."""


@dataclass(frozen=True)
class DepthLosses:
    """The terms, unweighted, and their weighted sum.

    Attributes:
        log: L_log, mean |log depth - log truth|.
        gradients: L_grad, gradient matching of log depth.
        distribution: L_dist, mean cross-entropy of a texel's distribution over the candidates [nat].
        sharp: L_sharp, of the depth after convex upsampling; 0 if its weight is 0.
        total: the weighted sum, which training minimises.
    """

    log: Float[Tensor, ""]
    gradients: Float[Tensor, ""]
    distribution: Float[Tensor, ""]
    sharp: Float[Tensor, ""]
    total: Float[Tensor, ""]


def depth_losses(
    coarse: CoarseDepth, truth: Float[Tensor, "*batch v h w"], weights: DepthLossWeights | None = None
) -> DepthLosses:
    """The losses of a plane sweep's depth.

    Args:
        coarse: the depth.
        truth: z-depth of each pixel [m], 0 = unknown.
        weights: of the terms; None is the defaults.

    Raises:
        ValueError: `sharp` has a weight, but the depth was not upsampled by convex weights.
    """
    weights = weights or DepthLossWeights()
    truth = truth.to(coarse.depths)
    log = depth_error(coarse.depths, truth)
    gradients = gradient_matching(coarse.depths, truth)
    at_centres = truth[..., SHRINK // 2 :: SHRINK, SHRINK // 2 :: SHRINK]
    distribution = candidate_cross_entropy(coarse.probabilities, coarse.candidates, at_centres, coarse.spacing)
    total = weights.log * log + weights.gradients * gradients + weights.distribution * distribution
    sharp = torch.zeros_like(log)
    if weights.sharp:
        if coarse.finer is None:
            raise ValueError("the loss of sharp depth needs a network with convex depth upsampling")
        sharp = sharp_loss(coarse.finer.mean, truth)
        total = total + weights.sharp * sharp
    return DepthLosses(log, gradients, distribution, sharp, total)


def sharp_loss(depths: Float[Tensor, "*batch v h w"], truth: Float[Tensor, "*batch v h w"]) -> Float[Tensor, ""]:
    """L_sharp: where the edges of depth are, whatever the error of whole surfaces.

    The sum of a mean of |e - s| in which pixels near edges count `AT_EDGES` times, and half of `gradient_matching`. With
    e = log depth - log truth, s is the mean of e over the known pixels of a window that are not near an edge, without gradient: it shifts the
    truth, so that a surface that the plane sweep puts too far as a whole costs nothing. It is 0 if the window has no such pixel.
    """
    known, near = truth > 0, near_edges(truth)
    error = depths.log() - torch.where(known, truth, 1).log()
    shift = _smoothed(error.detach(), known & ~near)
    weights = known * torch.where(near, AT_EDGES, 1.0).to(error)
    mean = ((error - shift).abs() * weights).sum((-2, -1)) / weights.sum((-2, -1)).clamp(min=1)
    return mean.mean() + 0.5 * gradient_matching(depths, truth)


def near_edges(truth: Float[Tensor, "*batch v h w"]) -> Bool[Tensor, "*batch v h w"]:
    """The pixels at most `NEAR_EDGE` pixels from a depth edge; unknown depth (0) makes no edge."""
    flat = truth.reshape(-1, 1, *truth.shape[-2:])
    known = flat > 0
    logs = torch.where(known, flat, 1).log()
    nearest = -max_pool2d(torch.where(known, -logs, -torch.inf), 3, 1, 1)
    farthest = max_pool2d(torch.where(known, logs, -torch.inf), 3, 1, 1)
    wide, reach = (farthest - nearest > EDGE).to(flat.dtype), 2 * NEAR_EDGE + 1
    for window, margin in (
        ((reach, 1), (NEAR_EDGE, 0)),
        ((1, reach), (0, NEAR_EDGE)),
    ):  # rows, then columns: much faster
        wide = max_pool2d(wide, window, 1, margin)
    return (wide > 0).reshape(truth.shape)


def gradient_matching(depths: Float[Tensor, "*batch v h w"], truth: Float[Tensor, "*batch v h w"]) -> Float[Tensor, ""]:
    """How much the error of log depth changes between neighbours, summed over scales (Eigen and Fergus 2015; MiDaS).

    With e = log depth - log truth at every s-th pixel, each scale s of `STRIDES` adds the sum of |e_right - e| + |e_below - e| over
    pairs with known true depths, divided by the number of pixels with known true depth. A constant factor of depth costs nothing;
    blurred edges and bent walls do.
    """
    known = truth > 0
    error = depths.log() - torch.where(known, truth, 1).log()
    scales = [_steps(error[..., ::stride, ::stride], known[..., ::stride, ::stride]) for stride in STRIDES]
    return torch.stack(scales).sum(0).mean()


def candidate_cross_entropy(
    probabilities: Float[Tensor, "*batch v l h4 w4"],
    candidates: Float[Tensor, "*batch v l"],
    truth: Float[Tensor, "*batch v h4 w4"],
    spacing: Literal["inverse", "linear"] = "inverse",
) -> Float[Tensor, ""]:
    """- sum_l t_l log p_l, the mean over texels with true depth within the candidates, then over views [nat].

    The target t is 1 at a candidate; between two candidates it is split linearly in the quantity in which they are evenly spaced. The
    minimum is the entropy of t, up to log 2.

    Args:
        probabilities: of the candidates.
        candidates: their depths, far to near [m].
        truth: z-depth at the centre of each texel [m], 0 = unknown; sampled, never averaged over an edge.
        spacing: the quantity in which candidates are evenly spaced, inverse depth or depth.
    """
    far, near = (candidates[..., end, None, None] for end in (0, -1))
    inside = (truth >= near) & (truth <= far)
    depths = torch.where(inside, truth, near)
    first, place, last = (far, depths, near) if spacing == "linear" else (1 / far, 1 / depths, 1 / near)
    steps = candidates.shape[-1] - 1
    position = (place - first) / (last - first) * steps
    lower = position.floor().clamp(0, steps - 1)
    share = (position - lower)[..., None, :, :]
    index = lower.long()[..., None, :, :]
    # The smallest normal number replaces a zero that rounding might leave.
    logarithms = probabilities.clamp(min=torch.finfo(probabilities.dtype).tiny).log()
    terms = (1 - share) * logarithms.gather(-3, index) + share * logarithms.gather(-3, index + 1)
    return per_known_pixel((-terms[..., 0, :, :] * inside).sum((-2, -1)), inside).mean()


def _smoothed(maps: Float[Tensor, "*batch h w"], counted: Bool[Tensor, "*batch h w"]) -> Float[Tensor, "*batch h w"]:
    """The mean of maps over the counted pixels of a window around each pixel; 0 if there are none."""

    def smoothed(one: Tensor) -> Tensor:
        flat = one.reshape(-1, 1, *maps.shape[-2:])
        for window, margin in (((SMOOTHING, 1), (SMOOTHING // 2, 0)), ((1, SMOOTHING), (0, SMOOTHING // 2))):
            flat = avg_pool2d(flat, window, 1, margin)
        return flat.reshape(maps.shape)

    sums, counts = smoothed(maps * counted), smoothed(counted.to(maps.dtype))
    return torch.where(counts > 0, sums / counts.clamp(min=0.5 / SMOOTHING**2), 0)


def _steps(error: Float[Tensor, "*batch h w"], known: Bool[Tensor, "*batch h w"]) -> Float[Tensor, "*batch"]:
    """The sum of |differences| of an error to the right and down, between known pixels, over the number of known pixels."""
    right, down = known[..., 1:] & known[..., :-1], known[..., 1:, :] & known[..., :-1, :]
    total = (error.diff(dim=-1).abs() * right).sum((-2, -1)) + (error.diff(dim=-2).abs() * down).sum((-2, -1))
    return per_known_pixel(total, known)
