"""Losses of depth by plane sweep against true depth. Nothing is rendered, and none is part of the paper.

    L = log L_log + gradients L_grad + distribution L_dist

As in `semgs.objectives.losses`, every term is one number per view, averaged over views and batch. Pixels with unknown true depth (0) do
not count, and a view without any true depth counts as 0.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

import torch
from jaxtyping import Bool, Float
from torch import Tensor

from semgs.objectives.loss_weights import DepthLossWeights
from semgs.objectives.losses import depth_error, per_known_pixel
from semgs.scene.coarse_depth import SHRINK, CoarseDepth

STRIDES = (1, 2, 4, 8)
"""The scales of gradient matching: steps in pixels between the compared pixels."""


@dataclass(frozen=True)
class DepthLosses:
    """The terms, unweighted, and their weighted sum.

    Attributes:
        log: L_log, mean |log depth - log truth|.
        gradients: L_grad, gradient matching of log depth.
        distribution: L_dist, mean cross-entropy of a texel's distribution over the candidates [nat].
        total: the weighted sum, which training minimises.
    """

    log: Float[Tensor, ""]
    gradients: Float[Tensor, ""]
    distribution: Float[Tensor, ""]
    total: Float[Tensor, ""]


def depth_losses(
    coarse: CoarseDepth, truth: Float[Tensor, "*batch v h w"], weights: DepthLossWeights | None = None
) -> DepthLosses:
    """The losses of a plane sweep's depth.

    Args:
        coarse: the depth.
        truth: z-depth of each pixel [m], 0 = unknown.
        weights: of the terms; None is the defaults.
    """
    weights = weights or DepthLossWeights()
    truth = truth.to(coarse.depths)
    log = depth_error(coarse.depths, truth)
    gradients = gradient_matching(coarse.depths, truth)
    at_centres = truth[..., SHRINK // 2 :: SHRINK, SHRINK // 2 :: SHRINK]
    distribution = candidate_cross_entropy(coarse.probabilities, coarse.candidates, at_centres, coarse.spacing)
    total = weights.log * log + weights.gradients * gradients + weights.distribution * distribution
    return DepthLosses(log, gradients, distribution, total)


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


def _steps(error: Float[Tensor, "*batch h w"], known: Bool[Tensor, "*batch h w"]) -> Float[Tensor, "*batch"]:
    """The sum of |differences| of an error to the right and down, between known pixels, over the number of known pixels."""
    right, down = known[..., 1:] & known[..., :-1], known[..., 1:, :] & known[..., :-1, :]
    total = (error.diff(dim=-1).abs() * right).sum((-2, -1)) + (error.diff(dim=-2).abs() * down).sum((-2, -1))
    return per_known_pixel(total, known)
