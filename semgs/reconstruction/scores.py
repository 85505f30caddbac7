"""Scores of one rendered view against what its camera saw, as far as the truth is known."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

from jaxtyping import Bool, Float
from torch import Tensor

from semgs.data.views import Views
from semgs.figures.classes import SEEN_ALPHA
from semgs.objectives.metrics import accuracy, confusion_matrices, miou, present_classes, psnr
from semgs.rendering.rendering import Rendering, likeliest


@dataclass(frozen=True)
class ViewScores:
    """How one view turned out.

    Attributes:
        psnr: of the picture against the photo, all pixels [dB]; infinite if they are equal.
        coverage: share of the pixels that were seen (alpha >= 0.5), 0..1.
        psnr_seen: as `psnr`, over the pixels that were seen; None if there are none.
        depth_error: mean of |z - truth| / truth over pixels that were seen and have a true depth; None without one.
        accuracy: share of the labelled pixels whose likeliest class is the true one; None without labels.
        miou: mean IoU over the classes that the true labels of this view show; None without labels.
    """

    psnr: float
    coverage: float
    psnr_seen: float | None = None
    depth_error: float | None = None
    accuracy: float | None = None
    miou: float | None = None


def scores(rendering: Rendering, truth: Views) -> tuple[ViewScores, ...]:
    """The scores of each view of a scene.

    Classes are compared as arg max of the distribution at every labelled pixel, whether it was seen or not.

    Args:
        rendering: of `truth.cameras`, without a batch axis.
        truth: what the cameras saw; its labels refer to the table of the rendering's classes.
    """
    ratios = psnr(rendering.images, truth.images).tolist()
    seen = rendering.alphas >= SEEN_ALPHA
    coverages = seen.double().mean((-2, -1)).tolist()
    seen_ratios = [_seen_psnr(*maps) for maps in zip(rendering.images, truth.images, seen, strict=True)]
    errors: Sequence[float | None] = [None] * len(ratios)
    if truth.depths is not None:
        errors = [_depth_error(*maps) for maps in zip(rendering.depths, truth.depths, seen, strict=True)]
    hits: Sequence[float | None] = [None] * len(ratios)
    ious: Sequence[float | None] = hits
    if truth.labels is not None and rendering.semantics is not None:
        count = rendering.semantics.shape[-3]
        confusions = confusion_matrices(likeliest(rendering.semantics), truth.labels, count)
        labelled = [bool(present_classes(labels, count).any()) for labels in truth.labels]
        hits = [value if known else None for value, known in zip(accuracy(confusions).tolist(), labelled, strict=True)]
        ious = [value if known else None for value, known in zip(miou(confusions).tolist(), labelled, strict=True)]
    return tuple(ViewScores(*values) for values in zip(ratios, coverages, seen_ratios, errors, hits, ious, strict=True))


def mean_scores(views: Sequence[ViewScores]) -> ViewScores:
    """The mean of each score over the views that have it; there must be a view."""
    return ViewScores(
        psnr=sum(view.psnr for view in views) / len(views),
        coverage=sum(view.coverage for view in views) / len(views),
        psnr_seen=_mean([view.psnr_seen for view in views]),
        depth_error=_mean([view.depth_error for view in views]),
        accuracy=_mean([view.accuracy for view in views]),
        miou=_mean([view.miou for view in views]),
    )


def _mean(values: Sequence[float | None]) -> float | None:
    """The mean of what is known, None if nothing is."""
    known = [value for value in values if value is not None]
    return sum(known) / len(known) if known else None


def _seen_psnr(image: Float[Tensor, "3 h w"], truth: Float[Tensor, "3 h w"], seen: Bool[Tensor, "h w"]) -> float | None:
    """PSNR of one view over the pixels that were seen, None where there are none [dB]."""
    if not seen.any():
        return None
    return float(psnr(image[:, seen][..., None], truth[:, seen][..., None]))


def _depth_error(depths: Float[Tensor, "h w"], truth: Float[Tensor, "h w"], seen: Bool[Tensor, "h w"]) -> float | None:
    """Mean relative error of one view's depth, None where no pixel is both seen and measured."""
    counted = seen & (truth > 0) & (depths > 0)
    if not counted.any():
        return None
    return float(((depths - truth).abs() / truth)[counted].double().mean())
