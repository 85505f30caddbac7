"""Scores of one rendered view against what its camera saw, as far as the truth is known."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

from semgs.data.views import Views
from semgs.figures.classes import SEEN_ALPHA
from semgs.objectives.map_scores import Maps, map_scores
from semgs.rendering.rendering import Rendering, likeliest


@dataclass(frozen=True)
class ViewScores:
    """How one view turned out. A pixel was seen if its alpha is at least 0.5.

    Attributes:
        psnr: of the picture against the photo, all pixels [dB]; infinite if they are equal.
        coverage: share of the pixels that were seen, 0..1.
        psnr_seen: as `psnr`, over the pixels that were seen; None if there are none.
        depth_error: as `depth_abs_rel`, over the pixels that were seen; None without one that has a true depth.
        accuracy: share of the labelled pixels whose likeliest class is the true one; None without labels.
        miou: mean IoU over the classes that the true labels of this view show; None without labels.
        accuracy_seen, miou_seen: the same over the pixels that were seen; None without a labelled one.
        depth_abs_rel: mean of |z - truth| / truth over all pixels with a true depth; None without one.
        depth_pixels, depth_pixels_seen: how many have a true depth, altogether and of those that were seen.
    """

    psnr: float
    coverage: float
    psnr_seen: float | None = None
    depth_error: float | None = None
    accuracy: float | None = None
    miou: float | None = None
    accuracy_seen: float | None = None
    miou_seen: float | None = None
    depth_abs_rel: float | None = None
    depth_pixels: int = 0
    depth_pixels_seen: int = 0


def scores(rendering: Rendering, truth: Views) -> tuple[ViewScores, ...]:
    """The scores of each view of a scene.

    Classes are compared as arg max of the distribution at every labelled pixel, whether it was seen or not, and once more at
    those that were seen.

    Args:
        rendering: of `truth.cameras`, without a batch axis.
        truth: what the cameras saw; its labels refer to the table of the rendering's classes.
    """
    return tuple(_scores_of(rendering, truth, index) for index in range(len(truth)))


def mean_scores(views: Sequence[ViewScores]) -> ViewScores:
    """The mean of each score over the views that have it; errors of depth over all their pixels. There must be a view."""
    pixels, pixels_seen = [view.depth_pixels for view in views], [view.depth_pixels_seen for view in views]
    return ViewScores(
        psnr=sum(view.psnr for view in views) / len(views),
        coverage=sum(view.coverage for view in views) / len(views),
        psnr_seen=_mean([view.psnr_seen for view in views]),
        depth_error=_mean([view.depth_error for view in views], pixels_seen),
        accuracy=_mean([view.accuracy for view in views]),
        miou=_mean([view.miou for view in views]),
        accuracy_seen=_mean([view.accuracy_seen for view in views]),
        miou_seen=_mean([view.miou_seen for view in views]),
        depth_abs_rel=_mean([view.depth_abs_rel for view in views], pixels),
        depth_pixels=sum(pixels),
        depth_pixels_seen=sum(pixels_seen),
    )


def by_measure(score: ViewScores) -> dict[str, float]:
    """The scores that are known, by the names and in the order of `semgs.objectives.measures.TITLES`."""
    found = {
        "miou_per_image": score.miou,
        "miou_per_image_seen": score.miou_seen,
        "accuracy_per_image": score.accuracy,
        "accuracy_per_image_seen": score.accuracy_seen,
        "psnr": score.psnr,
        "psnr_seen": score.psnr_seen,
        "depth_abs_rel": score.depth_abs_rel,
        "depth_abs_rel_seen": score.depth_error,
        "unseen": 1 - score.coverage,
    }
    return {name: value for name, value in found.items() if value is not None}


def _scores_of(rendering: Rendering, truth: Views, index: int) -> ViewScores:
    """The scores of one view."""
    given = Maps(
        image=rendering.images[index],
        labels=None if rendering.semantics is None else likeliest(rendering.semantics[index]),
        depths=rendering.depths[index],
    )
    true = Maps(
        image=truth.images[index],
        labels=None if truth.labels is None else truth.labels[index],
        depths=None if truth.depths is None else truth.depths[index],
    )
    classes = 0 if rendering.semantics is None else rendering.semantics.shape[-3]
    seen = rendering.alphas[index] >= SEEN_ALPHA
    whole, part = map_scores(given, true, classes), map_scores(given, true, classes, seen)
    assert whole.psnr is not None
    return ViewScores(
        psnr=whole.psnr,
        coverage=float(seen.double().mean()),
        psnr_seen=part.psnr,
        depth_error=None if part.depth is None else part.depth.abs_rel,
        accuracy=whole.accuracy,
        miou=whole.miou,
        accuracy_seen=part.accuracy,
        miou_seen=part.miou,
        depth_abs_rel=None if whole.depth is None else whole.depth.abs_rel,
        depth_pixels=0 if whole.depth is None else whole.depth.pixels,
        depth_pixels_seen=0 if part.depth is None else part.depth.pixels,
    )


def _mean(values: Sequence[float | None], weights: Sequence[int] | None = None) -> float | None:
    """The mean of what is known, None if nothing is."""
    known = [
        (value, weight) for value, weight in zip(values, weights or [1] * len(values), strict=True) if value is not None
    ]
    return sum(value * weight for value, weight in known) / sum(weight for _, weight in known) if known else None
