"""Metrics of evaluation: PSNR, depth errors and, from confusion matrices, mean IoU and accuracies of two kinds.

The two kinds are: over one confusion matrix of the data set (as in the ScanNet benchmark), and per image, then averaged (as in S-Ray and
GSNeRF: `*_per_image`). The second is easier and noisier; never put the two in one column.
"""

from __future__ import annotations

from dataclasses import dataclass

import torch
from jaxtyping import Bool, Float, Int64, UInt8
from torch import Tensor

from semgs.data.tables.classes import IGNORE

DELTA = 1.25
"""`depth_delta_125` counts depths within this factor of the true one."""


@dataclass(frozen=True, eq=False)
class DepthScores:
    """Errors of depth over all pixels with a true depth; a pixel without a predicted depth has depth 0.

    Attributes:
        abs_rel: mean of |z - truth| / truth.
        delta: share of the pixels within a factor of 1.25.
        pixels: how many have a true depth.
    """

    abs_rel: float
    delta: float
    pixels: int


def squared_error(
    images: Float[Tensor, "*batch 3 h w"],
    truth: Float[Tensor, "*batch 3 h w"],
    hidden: Bool[Tensor, "*batch h w"] | None = None,
) -> Float[Tensor, "*batch"]:
    """Mean squared error of each image over its channels and pixels, but for hidden ones; 0 if all are hidden."""
    errors = (images - truth).square()
    if hidden is None:
        return errors.mean((-3, -2, -1))
    shown = ~hidden
    return (errors.mean(-3) * shown).sum((-2, -1)) / shown.sum((-2, -1)).clamp(min=1)


def psnr(
    images: Float[Tensor, "*batch 3 h w"],
    truth: Float[Tensor, "*batch 3 h w"],
    hidden: Bool[Tensor, "*batch h w"] | None = None,
) -> Float[Tensor, "*batch"]:
    """Peak signal-to-noise ratio of each image over all channels and all pixels that are not hidden, images clamped to 0..1 [dB].

    Equal images have infinite PSNR. For several images, reports give the mean of their values.
    """
    return -10 * squared_error(images.clamp(0, 1), truth, hidden).log10()


def psnr_seen(
    image: Float[Tensor, "3 h w"], truth: Float[Tensor, "3 h w"], seen: Bool[Tensor, "h w"]
) -> Float[Tensor, ""] | None:
    """`psnr` of one image over the seen pixels, None if there are none [dB]."""
    return psnr(image[:, seen][..., None], truth[:, seen][..., None]) if seen.any() else None


def confusion_matrix(
    predicted: UInt8[Tensor, "*batch h w"], truth: UInt8[Tensor, " ..."], classes: int
) -> Int64[Tensor, "class class"]:
    """Counts of pixels, rows by true class, columns by predicted class.

    Pixels without truth (255) are not counted, nor are pixels without a prediction (255). If there may be such pixels, pass the
    `present` classes to the metrics. Matrices of several images can be added.

    Raises:
        ValueError: a prediction is outside the classes, or shapes differ.
    """
    if predicted.shape != truth.shape:
        raise ValueError(f"predicted labels are {tuple(predicted.shape)} but the true ones {tuple(truth.shape)}")
    counted = (truth != IGNORE) & (predicted != IGNORE)
    for name, labels in (("predicted", predicted), ("true", truth)):
        if (labels[counted] >= classes).any():
            raise ValueError(
                f"{name} labels contain {int(labels[counted].max())}; expected 0..{classes - 1}, or {IGNORE} for none"
            )
    pairs = truth[counted].long() * classes + predicted[counted].long()
    return torch.bincount(pairs, minlength=classes**2).reshape(classes, classes)


def present_classes(truth: UInt8[Tensor, "*batch h w"], classes: int) -> Bool[Tensor, " class"]:
    """Which classes occur in the truth, whatever was predicted there."""
    return torch.bincount(truth[truth != IGNORE].flatten().long(), minlength=classes) > 0


def intersection_over_union(confusion: Int64[Tensor, "*batch class class"]) -> Float[Tensor, "*batch class"]:
    """C_kk / (row_k + column_k - C_kk) of each class; 0 for a class that is neither true nor predicted."""
    hits = confusion.diagonal(dim1=-2, dim2=-1).double()
    return _ratio(hits, confusion.sum(-1) + confusion.sum(-2) - hits)


def miou(
    confusion: Int64[Tensor, "*batch class class"], present: Bool[Tensor, "*batch class"] | None = None
) -> Float[Tensor, "*batch"]:
    """Mean IoU over the classes in the truth; 0 if there are none.

    A class that is only predicted adds no term; its pixels count as misses of their true class.

    Args:
        confusion: rows by true class.
        present: the classes to average over; None is those with a count in their row.
    """
    return _mean_over(intersection_over_union(confusion), confusion, present)


def class_accuracy(
    confusion: Int64[Tensor, "*batch class class"], present: Bool[Tensor, "*batch class"] | None = None
) -> Float[Tensor, "*batch"]:
    """Share of each class's pixels that are right, averaged over the classes in the truth; 0 if there are none."""
    hits = confusion.diagonal(dim1=-2, dim2=-1).double()
    return _mean_over(_ratio(hits, confusion.sum(-1)), confusion, present)


def accuracy(confusion: Int64[Tensor, "*batch class class"]) -> Float[Tensor, "*batch"]:
    """Share of the counted pixels that are right; 0 if there are none."""
    return _ratio(confusion.diagonal(dim1=-2, dim2=-1).sum(-1), confusion.sum((-2, -1)))


def depth_scores(
    depths: Float[Tensor, "*batch h w"],
    truth: Float[Tensor, "*batch h w"],
    seen: Bool[Tensor, "*batch h w"] | None = None,
) -> DepthScores | None:
    """Errors of depth over all or the seen pixels with known truth (> 0); None if there are no such pixels."""
    known = truth > 0 if seen is None else seen & (truth > 0)
    if not known.any():
        return None
    predicted, true = depths[known].double(), truth[known].double()
    within = (predicted < DELTA * true) & (true < DELTA * predicted)
    return DepthScores(
        abs_rel=float(((predicted - true).abs() / true).mean()),
        delta=float(within.double().mean()),
        pixels=int(known.sum()),
    )


def _mean_over(
    values: Float[Tensor, "*batch class"],
    confusion: Int64[Tensor, "*batch class class"],
    present: Bool[Tensor, "*batch class"] | None,
) -> Float[Tensor, "*batch"]:
    """The mean of values over the present classes, 0 if there are none."""
    counted = confusion.sum(-1) > 0 if present is None else present
    return _ratio((values * counted).sum(-1), counted.sum(-1))


def _ratio(numerator: Tensor, denominator: Tensor) -> Float[Tensor, "*batch"]:
    """The quotient in float64, 0 for 0 / 0."""
    return numerator.double() / denominator.clamp(min=1)
