"""Simple baselines for every table. All but the first reconstruct nothing and use ground truth that no method gets.

- one_pass: the method itself before it refines its Gaussians on the input views; only of a method that does.
- copy: image, true labels and true depth of the nearest context, as if the camera had not moved.
- warp: images and true labels of the contexts, warped to the target with the target's true depth.
- majority: the most frequent true class of the whole set, everywhere.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import torch
from jaxtyping import Bool, Float, Int64
from torch import Tensor
from torch.nn.functional import grid_sample

from semgs.data.views import Views
from semgs.evaluation.frames.predictions import Prediction
from semgs.geometry.cameras import back_project, project

SAME_SURFACE = 0.05
"""A context sees a point if its own true depth there agrees within this share of the depth."""

NAMES = {
    "one_pass": "the same Gaussians before they were refined on the input views",
    "copy": "oracle: the nearest input view copied (its image, its true labels), as if the camera had not moved",
    "warp": "oracle: input views warped with true depth (their images, their true labels)",
    "majority": "most frequent class of all true pixels, everywhere",
}


def copy_nearest(nearest: Views) -> Prediction:
    """Image, true labels and true depth of the nearest context, used as a prediction for the target."""
    return Prediction(
        labels=None if nearest.labels is None else nearest.labels[0],
        image=nearest.images[0],
        depths=None if nearest.depths is None else nearest.depths[0],
    )


def warp_contexts(contexts: Sequence[Views], target: Views) -> Prediction | None:
    """The contexts' images and true labels, warped to the target with its true depth.

    Each pixel comes from the nearest context that sees its point. If none does, or the depth is unknown, it comes from `copy_nearest`
    and counts as unseen. Colours are interpolated linearly; labels come from the pixel that contains the point.

    Args:
        contexts: single views, the nearest first.
        target: a single view.

    Returns:
        None if the target or a context has no true depth.
    """
    if target.depths is None or any(one.depths is None for one in contexts):
        return None
    filled = torch.zeros(target.size, dtype=torch.bool)
    fallback = copy_nearest(contexts[0])
    assert fallback.image is not None
    image, labels = fallback.image.clone(), None if fallback.labels is None else fallback.labels.clone()
    points = back_project(target.depths.double(), target.cameras).reshape(1, -1, 3)
    for context in contexts:
        positions = project(points, context.cameras)[0].reshape(*target.size, 3)
        fresh = _sees(context, positions) & (target.depths[0] > 0) & ~filled
        image = torch.where(fresh, _interpolated(context, positions), image)
        if labels is not None and context.labels is not None:
            row, column = _pixels(context, positions)
            labels = torch.where(fresh, context.labels[0][row, column], labels)
        filled |= fresh
    return Prediction(labels=labels, image=image, unseen=~filled)


def predict_majority(truths: Sequence[Int64[np.ndarray, " class"]]) -> list[Int64[np.ndarray, "class class"]]:
    """The confusion matrix of each image if every pixel is predicted as the most frequent class of all images.

    Args:
        truths: pixels of each image by true class.
    """
    favourite = int(np.sum(truths, axis=0).argmax())
    matrices = [np.zeros((len(truth), len(truth)), np.int64) for truth in truths]
    for matrix, truth in zip(matrices, truths, strict=True):
        matrix[:, favourite] = truth
    return matrices


def _sees(context: Views, positions: Float[Tensor, "h w 3"]) -> Bool[Tensor, "h w"]:
    """Whether points at (x, y, z) of a context are inside its image and not behind the surface it shows there."""
    assert context.depths is not None
    x, y, z = positions.unbind(-1)
    height, width = context.size
    inside = (z > 0) & (x >= 0) & (x < width) & (y >= 0) & (y < height)
    row, column = _pixels(context, positions)
    depth = context.depths[0][row, column].to(z)
    return inside & ((z - depth).abs() <= SAME_SURFACE * depth)


def _pixels(context: Views, positions: Float[Tensor, "h w 3"]) -> tuple[Tensor, Tensor]:
    """Row and column of the pixels that contain the positions; positions outside are moved to the border."""
    height, width = context.size
    place = positions[..., :2].nan_to_num(0).clamp(-1, max(height, width)).floor().long()
    return place[..., 1].clamp(0, height - 1), place[..., 0].clamp(0, width - 1)


def _interpolated(context: Views, positions: Float[Tensor, "h w 3"]) -> Float[Tensor, "3 h w"]:
    """The image of a context at some positions, interpolated linearly."""
    height, width = context.size
    grid = 2 * positions[..., :2].nan_to_num(0) / torch.tensor([width, height], dtype=torch.float64) - 1
    sampled = grid_sample(
        context.images.double(), grid[None], mode="bilinear", padding_mode="border", align_corners=False
    )
    return sampled[0].to(context.images).clamp(0, 1)
