"""Scores of rendered views against the true views."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, fields

from semgs.data.views import Views
from semgs.objectives.map_scores import Maps, map_scores
from semgs.rendering.rendering import SEEN_ALPHA, Rendering, likeliest


@dataclass(frozen=True)
class ViewScores:
    """The scores of one view, without its hidden pixels (`Views.hidden`). A pixel is seen if its alpha is at least 0.5.

    Attributes:
        psnr: over all pixels [dB]; infinite if the images are equal.
        coverage: share of seen pixels, 0..1.
        psnr_seen: like `psnr`, over the seen pixels; None if there are none.
        depth_error: like `depth_abs_rel`, over the seen pixels; None if none of them has a true depth.
        accuracy: share of the labelled pixels whose likeliest class is correct; None without labels.
        miou: mean IoU over the true classes of this view; None without labels.
        accuracy_seen, miou_seen: the same over the seen pixels; None if none of them is labelled.
        depth_abs_rel: mean of |z - truth| / truth over all pixels with a true depth; None if there are none.
        depth_pixels, depth_pixels_seen: number of pixels with a true depth: all, and those seen.
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

    The class of a pixel is the arg max of its distribution. Classes are compared at every labelled pixel, and again at the seen ones.

    Args:
        rendering: from `truth.cameras`, without a batch axis.
        truth: the true views; their labels have the class table of the rendering.
    """
    return tuple(_scores_of(rendering, truth, index) for index in range(len(truth)))


def mean_scores(views: Sequence[ViewScores]) -> ViewScores:
    """The mean of each score over the views that have it, of depth errors over all their pixels. Needs at least one view."""
    weights = {"depth_error": "depth_pixels_seen", "depth_abs_rel": "depth_pixels"}

    def mean(name: str) -> float | None:
        found = [(getattr(view, name), getattr(view, weights[name]) if name in weights else 1) for view in views]
        known = [(value, weight) for value, weight in found if value is not None]
        return sum(value * weight for value, weight in known) / sum(weight for _, weight in known) if known else None

    means = {one.name: mean(one.name) for one in fields(ViewScores)}
    return ViewScores(**means | {name: sum(getattr(view, name) for view in views) for name in weights.values()})


def by_measure(score: ViewScores) -> dict[str, float]:
    """The known scores, with the names and in the order of `semgs.objectives.measures.TITLES`."""
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
    shown = None if truth.hidden is None else ~truth.hidden[index]
    seen = rendering.alphas[index] >= SEEN_ALPHA
    whole = map_scores(given, true, classes, shown)
    part = map_scores(given, true, classes, seen if shown is None else seen & shown)
    assert whole.psnr is not None
    return ViewScores(
        psnr=whole.psnr,
        coverage=float((seen if shown is None else seen[shown]).double().mean()),
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
