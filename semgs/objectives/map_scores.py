"""Scores of one view's maps against the truth, for reconstructions and evaluations alike."""

from __future__ import annotations

from dataclasses import dataclass

from jaxtyping import Bool, Float, Int64, UInt8
from torch import Tensor

from semgs.data.tables.classes import IGNORE
from semgs.objectives.metrics import (
    DepthScores,
    accuracy,
    confusion_matrix,
    depth_scores,
    miou,
    present_classes,
    psnr,
    psnr_seen,
)


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
