"""Metrics of evaluation: PSNR, depth errors and, from confusion matrices, mean IoU and accuracies of two kinds; and all of them for the maps of one view.

The two kinds are: over one confusion matrix of the data set (as in the ScanNet benchmark), and per image, then averaged (as in S-Ray and
GSNeRF: `*_per_image`). The second is easier and noisier; never put the two in one column.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np
import torch
from jaxtyping import Bool, Float, Int64, UInt8
from torch import Tensor

from semgs.data.tables.classes import IGNORE

DELTA = 1.25
"""`depth_delta_125` counts depths within this factor of the true one."""


@dataclass(frozen=True)
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


@dataclass(frozen=True, eq=False)
class Maps:
    """The maps of one view, rendered or true; None for a missing map.

    Attributes:
        image: RGB, 0..1.
        labels: the class of each pixel, 255 for none.
        depths: z-depth, 0 for none.
    """

    image: Float[Tensor, "3 h w"] | None = None
    labels: UInt8[Tensor, "h w"] | None = None
    depths: Float[Tensor, "h w"] | None = None


@dataclass(frozen=True, eq=False)
class MapScores:
    """Scores of a view's maps; None if either map is missing.

    Attributes:
        confusion: pixels by true (rows) and predicted class, of those with both labels.
        miou, accuracy: mean IoU over the true classes, and share of the pixels with both labels; None also without a true label.
        psnr: [dB].
        depth: over the pixels with a true depth; None also without any.
    """

    confusion: Int64[Tensor, "class class"] | None = None
    miou: float | None = None
    accuracy: float | None = None
    psnr: float | None = None
    depth: DepthScores | None = None


def map_scores(given: Maps, truth: Maps, classes: int, seen: Bool[Tensor, "h w"] | None = None) -> MapScores:
    """Compare a rendered view with the true one, over all pixels or over the seen ones.

    Args:
        given: the rendered maps.
        truth: the true maps, at the same size.
        classes: number of classes in the table of the labels.
        seen: the pixels to compare; None is all.
    """
    confusion = mean_iou = hits = ratio = depth = None
    if given.labels is not None and truth.labels is not None:
        labels = truth.labels if seen is None else truth.labels.masked_fill(~seen, IGNORE)
        confusion = confusion_matrix(given.labels, labels, classes)
        present = present_classes(labels, classes)
        if present.any():
            mean_iou, hits = float(miou(confusion, present)), float(accuracy(confusion))
    if given.image is not None and truth.image is not None:
        found = psnr(given.image, truth.image) if seen is None else psnr_seen(given.image, truth.image, seen)
        ratio = None if found is None else float(found)
    if given.depths is not None and truth.depths is not None:
        depth = depth_scores(given.depths, truth.depths, seen)
    return MapScores(confusion, mean_iou, hits, ratio, depth)


@dataclass(frozen=True, kw_only=True)
class ViewScores:
    """Scores of a view, without its hidden pixels; None if the truth or the prediction is missing. Those that end in `_seen` are over the pixels that the method saw; they are
    None also if it saw none, or does not say.

    Attributes:
        confusion: number of pixels by true (rows) and predicted class, where both are known.
        psnr, psnr_seen: [dB]; infinite for equal images.
        depth, depth_seen: of the depth map.
        unseen: share of the pixels where the method saw nothing.
        miou, miou_seen: mean IoU over the true classes of this view.
        accuracy, accuracy_seen: share of the labelled pixels whose likeliest class is correct.
    """

    confusion: Int64[np.ndarray, "class class"] | None = field(default=None, compare=False)
    psnr: float | None = None
    psnr_seen: float | None = None
    depth: DepthScores | None = None
    depth_seen: DepthScores | None = None
    unseen: float | None = None
    miou: float | None = None
    miou_seen: float | None = None
    accuracy: float | None = None
    accuracy_seen: float | None = None

    @property
    def coverage(self) -> float:
        """Share of seen pixels; 1 if the method does not say."""
        return 1 - (self.unseen or 0.0)

    @property
    def by_measure(self) -> dict[str, float]:
        """The known scores, with the names and in the order of `semgs.objectives.measures.TITLES`."""
        found = {
            "miou_per_image": self.miou,
            "miou_per_image_seen": self.miou_seen,
            "accuracy_per_image": self.accuracy,
            "accuracy_per_image_seen": self.accuracy_seen,
            "psnr": self.psnr,
            "psnr_seen": self.psnr_seen,
            "depth_abs_rel": None if self.depth is None else self.depth.abs_rel,
            "depth_abs_rel_seen": None if self.depth_seen is None else self.depth_seen.abs_rel,
            "unseen": self.unseen,
        }
        return {name: value for name, value in found.items() if value is not None}


def view_scores(
    given: Maps, truth: Maps, classes: int, hidden: Bool[Tensor, "h w"] | None, unseen: Bool[Tensor, "h w"] | None
) -> ViewScores:
    """Compare a rendered view with the true one.

    Args:
        given: the rendered maps.
        truth: the true maps, at the same size.
        classes: number of classes in the table of the labels.
        hidden: pixels of the truth that count in no score.
        unseen: pixels where the method saw nothing; None if it does not say.
    """
    shown = None if hidden is None else ~hidden
    whole, part = map_scores(given, truth, classes, shown), MapScores()
    if unseen is not None:
        part = map_scores(given, truth, classes, ~unseen if shown is None else shown & ~unseen)
        unseen = unseen if shown is None else unseen[shown]
    return ViewScores(
        confusion=None if whole.confusion is None else whole.confusion.numpy(),
        psnr=whole.psnr,
        psnr_seen=part.psnr,
        depth=whole.depth,
        depth_seen=part.depth,
        unseen=None if unseen is None else float(unseen.double().mean()),
        miou=whole.miou,
        miou_seen=part.miou,
        accuracy=whole.accuracy,
        accuracy_seen=part.accuracy,
    )


def mean_scores(views: Sequence[ViewScores]) -> ViewScores:
    """The mean of each score over the views that have it, of depth errors over all their pixels; without confusion."""

    def mean(name: str) -> float | None:
        known = [value for view in views if (value := getattr(view, name)) is not None]
        return sum(known) / len(known) if known else None

    def mean_depth(name: str) -> DepthScores | None:
        known = [value for view in views if (value := getattr(view, name)) is not None]
        pixels = sum(one.pixels for one in known)
        errors, shares = (sum(getattr(one, part) * one.pixels for one in known) for part in ("abs_rel", "delta"))
        return DepthScores(errors / pixels, shares / pixels, pixels) if known else None

    names = ("psnr", "psnr_seen", "unseen", "miou", "miou_seen", "accuracy", "accuracy_seen")
    means: dict[str, Any] = {name: mean(name) for name in names}
    return ViewScores(**means, depth=mean_depth("depth"), depth_seen=mean_depth("depth_seen"))
