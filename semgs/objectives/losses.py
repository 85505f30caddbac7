"""The loss: cross-entropy of classes, squared error of colour, regional smoothness of classes.

    L = semantic L_sem + colour L_c + smoothness L_rs                                     (the paper, section III-D)

Every term is one number per view, averaged over views and batch, so that the gradients of parts of a batch (several processes,
accumulated steps) average to the gradient of the batch.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Literal

import torch
from jaxtyping import Bool, Float, UInt8
from torch import Tensor
from torch.nn.functional import pad

from semgs.data.tables.classes import IGNORE
from semgs.data.views import Views
from semgs.objectives.loss_weights import LossWeights
from semgs.objectives.metrics import squared_error
from semgs.rendering.rendering import Rendering
from semgs.runtime.precision import in_full


@dataclass(frozen=True)
class Losses:
    """The terms, unweighted, and their weighted sum.

    Attributes:
        semantic: L_sem, mean cross-entropy of a labelled pixel [nat].
        colour: L_c, mean squared error of a channel of a pixel.
        smoothness: L_rs, a mean or a sum over pixels as `LossWeights.smoothness_over` says.
        total: the weighted sum, which training minimises.
        unlabelled: views whose semantic terms are 0, because they have no labelled pixel or the rendering has no classes.
    """

    semantic: Float[Tensor, ""]
    colour: Float[Tensor, ""]
    smoothness: Float[Tensor, ""]
    total: Float[Tensor, ""]
    unlabelled: int


def losses(
    rendering: Rendering,
    target: Views,
    weights: LossWeights | None = None,
    *,
    class_weights: Sequence[float] | None = None,
) -> Losses:
    """The paper's losses of rendered views.

    Ignored pixels (label 255) count in neither semantic term; the colour term ignores labels. Hidden pixels count in none.

    Args:
        rendering: the rendered target views [... v].
        target: the true views, with or without labels [... v].
        weights: of the terms; None is the paper's.
        class_weights: factors of the cross-entropy of each true class, to favour rare classes; None (the paper) is 1 for all. The
            divisor stays the number of labelled pixels.

    Raises:
        ValueError: size, number of views or classes of rendering and target differ.
    """
    weights = weights or LossWeights()
    if rendering.images.shape != target.images.shape:
        raise ValueError(
            f"the rendering is {tuple(rendering.images.shape)} but its target {tuple(target.images.shape)} "
            "([... view 3 height width]); render the target's cameras"
        )
    if target.hidden is None:
        colour = (rendering.images - target.images).square().mean()
    else:
        colour = squared_error(rendering.images, target.images, target.hidden).mean()
    views = target.images.shape[:-3].numel()
    semantic = smoothness = torch.zeros_like(colour)
    unlabelled = views
    if rendering.semantics is not None and target.labels is not None:
        if rendering.semantics.shape[-3] != len(target.classes):
            raise ValueError(
                f"the rendering has {rendering.semantics.shape[-3]} classes but table {target.classes.name} of the "
                f"target has {len(target.classes)}; train with the table of the labels"
            )
        if class_weights is not None and len(class_weights) != len(target.classes):
            raise ValueError(
                f"class_weights has {len(class_weights)} factors; expected {len(target.classes)}, one for each class of "
                f"table {target.classes.name}"
            )
        distributions = rendering.semantics.flatten(end_dim=-4)
        labels = target.labels.reshape(views, *target.size)
        semantic = cross_entropy(distributions, labels, class_weights).mean()
        smoothness = regional_smoothness(distributions, labels, weights.smoothness_over).mean()
        unlabelled = int((labels == IGNORE).flatten(1).all(1).sum())
    total = weights.semantic * semantic + weights.colour * colour + weights.smoothness * smoothness
    return Losses(semantic, colour, smoothness, total, unlabelled)


def cross_entropy(
    distributions: Float[Tensor, "v class h2 w2"],
    labels: UInt8[Tensor, "v h w"],
    class_weights: Sequence[float] | None = None,
    stride: int = 1,
) -> Float[Tensor, " v"]:
    """L_sem of each view: - sum_l S_l log S^_l, the mean over its labelled pixels; 0 for a view without any [nat].

    A rendered distribution is positive everywhere, because the light that passes all Gaussians is spread evenly over
    the classes. The smallest normal number replaces a zero that rounding might leave.

    Args:
        distributions: of the classes.
        labels: of the pixels.
        class_weights: factor of each true class; None is 1 for all.
        stride: pixels along each side that share a distribution. The last row and column may reach past the labels.
    """
    each = _per_distribution(labels, distributions.shape[-2:], stride)
    probability, labelled = _true_class_probability(distributions, each), each != IGNORE
    terms = -probability.clamp(min=torch.finfo(probability.dtype).tiny).log()
    if class_weights is not None:
        terms = terms * terms.new_tensor(class_weights)[_indices(each)]
    return per_known_pixel((terms * labelled).sum((-3, -2, -1)), labels != IGNORE)


def regional_smoothness(
    distributions: Float[Tensor, "v class h w"],
    labels: UInt8[Tensor, "v h w"],
    over: Literal["pixels", "sum"] = "pixels",
) -> Float[Tensor, " v"]:
    """L_rs of each view, divided by the number of its labelled pixels, or with `over` "sum" undivided; 0 for a view without any.

    The paper's double sum of |S^_l - S^_l| runs over classes l and over neighbours down and right that both belong to the region of l.
    A pixel belongs to one region only, so this is one sum over neighbours with equal labels, in the channel of that label. Borders
    between classes cost nothing.
    """
    probability, labelled = _true_class_probability(distributions, labels[:, None])[:, 0], labels != IGNORE
    down = (labels[..., 1:, :] == labels[..., :-1, :]) & labelled[..., 1:, :]
    right = (labels[..., :, 1:] == labels[..., :, :-1]) & labelled[..., :, 1:]
    total = (probability.diff(dim=-2).abs() * down).sum((-2, -1))
    total = total + (probability.diff(dim=-1).abs() * right).sum((-2, -1))
    return total if over == "sum" else per_known_pixel(total, labelled)


def depth_error(depths: Float[Tensor, "*batch v h w"], truth: Float[Tensor, "*batch v h w"]) -> Float[Tensor, ""]:
    """Mean |log depth - log truth| over the pixels with known truth (> 0), then over views; not part of the paper's loss.

    A factor of 1.1 costs the same near and far, and in any unit.
    """
    known = truth > 0
    error = (depths.log() - torch.where(known, truth, 1).log()).abs()
    return per_known_pixel((error * known).sum((-2, -1)), known).mean()


def _true_class_probability(
    distributions: Float[Tensor, "v class h w"], labels: UInt8[Tensor, "v s h w"]
) -> Float[Tensor, "v s h w"]:
    """The probability that each distribution gives to each of its s true classes, in float32 or better; of class 0 if ignored."""
    return in_full(distributions).gather(-3, _indices(labels))


def _per_distribution(labels: UInt8[Tensor, "v h w"], size: tuple[int, ...], stride: int) -> UInt8[Tensor, "v s h2 w2"]:
    """The s = stride x stride labels of each distribution; 255 past the borders of the image."""
    (rows, columns), (height, width) = size, labels.shape[-2:]
    whole = pad(labels, (0, stride * columns - width, 0, stride * rows - height), value=IGNORE)
    blocks = whole.reshape(-1, rows, stride, columns, stride)
    return blocks.permute(0, 2, 4, 1, 3).reshape(-1, stride * stride, rows, columns)


def _indices(labels: UInt8[Tensor, "*v h w"]) -> Tensor:
    """Labels as indices; ignored pixels become class 0 and must be masked."""
    return torch.where(labels == IGNORE, 0, labels).long()


def per_known_pixel(sums: Float[Tensor, "*batch"], known: Bool[Tensor, "*batch h w"]) -> Float[Tensor, "*batch"]:
    """Sums of views divided by the number of their pixels with a label or a depth; a sum over none stays 0."""
    return sums / known.sum((-2, -1)).clamp(min=1)
