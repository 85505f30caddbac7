"""Scores of what a visitor sees who steps aside: edges, sharpness, what is made up where no input view looked, and what floats in front."""

from __future__ import annotations

import torch
from jaxtyping import Bool, Float
from torch import Tensor
from torch.nn.functional import max_pool2d

from semgs.data.views import Views
from semgs.evaluation.frames.predictions import Prediction
from semgs.objectives.metrics import psnr_seen

STEP = 1.1
"""Depth steps between two neighbouring pixels if one is so many times as far as the other."""

EDGE_PX = 6
"""Edges are the pixels so near to a depth step, along rows and columns [px]."""

FLYER = 1.25
"""What is drawn floats if the true depth is more than so many times as far."""


def near_steps(depths: Float[Tensor, "h w"]) -> Bool[Tensor, "h w"]:
    """The pixels at most `EDGE_PX` from a pixel beside a depth step; next to unknown depth (0) there is none."""
    steps = torch.zeros(depths.shape, dtype=torch.bool)
    for one, other in (((slice(None), slice(1, None)), (slice(None), slice(-1))), ((slice(1, None),), (slice(-1),))):
        near, far = torch.minimum(depths[one], depths[other]), torch.maximum(depths[one], depths[other])
        jump = (near > 0) & (far > STEP * near)
        steps[one] |= jump
        steps[other] |= jump
    side = 2 * EDGE_PX + 1
    return max_pool2d(steps[None].float(), side, stride=1, padding=EDGE_PX)[0] > 0


def psnr_gradients(image: Float[Tensor, "3 h w"], truth: Float[Tensor, "3 h w"]) -> float | None:
    """PSNR of the differences between neighbours, along rows and columns together [dB]; None for equal ones."""
    wrong = [(image.double().diff(dim=axis) - truth.double().diff(dim=axis)).square() for axis in (1, 2)]
    mean = torch.cat([one.flatten() for one in wrong]).mean()
    return float(-10 * mean.log10()) if mean > 0 else None


def aside_scores(prediction: Prediction, truth: Views, unseen: Bool[Tensor, "h w"] | None) -> dict[str, float]:
    """Compare a prediction with a true view.

    Args:
        prediction: of the view.
        truth: the view alone.
        unseen: the pixels that no input view sees, by true depth; None if it is unknown.

    Returns:
        psnr_edges: at edges [dB].
        depth_edges: mean of |z - truth| / truth there.
        psnr_gradients: PSNR of horizontal and vertical differences of neighbouring pixels [dB]: noise lowers it, as blur does.
        made_up: share of the pixels that no input view sees which the method draws.
        flyers: share of the pixels that the method draws which float in front.
        Without those of which the truth or the prediction is missing, or no pixel counts.
    """
    image, depths, drawn = prediction.image, prediction.depths, prediction.unseen
    drawn = None if drawn is None else ~drawn
    true_depths = None if truth.depths is None else truth.depths[0]
    found: dict[str, float | None] = {}
    if image is not None:
        found["psnr_gradients"] = psnr_gradients(image, truth.images[0])
    if true_depths is not None:
        known, edges = true_depths > 0, near_steps(true_depths)
        if image is not None and edges.any():
            ratio = psnr_seen(image.double(), truth.images[0].double(), edges)
            found["psnr_edges"] = None if ratio is None else float(ratio)
        if depths is not None and (edges & known).any():
            wrong = (depths - true_depths).abs() / true_depths
            found["depth_edges"] = float(wrong[edges & known].double().mean())
        if drawn is not None and unseen is not None and (unseen & known).any():
            found["made_up"] = float(drawn[unseen & known].double().mean())
        if drawn is not None and depths is not None and (drawn & known).any():
            found["flyers"] = float((FLYER * depths < true_depths)[drawn & known].double().mean())
    return {name: value for name, value in found.items() if value is not None}
