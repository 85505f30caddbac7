"""Scores of one target: everything that is counted or measured there, from which all summaries are made."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from jaxtyping import Bool, Int64
from torch import Tensor

from semgs.data.classes import IGNORE
from semgs.data.views import Views
from semgs.evaluation.frames.plan import Task
from semgs.evaluation.frames.predictions import Prediction
from semgs.evaluation.scoring.similarity import PerceptualDistance, ssim
from semgs.objectives.metrics import (
    DELTA,
    DepthScores,
    accuracy,
    confusion_matrix,
    depth_scores,
    miou,
    present_classes,
    psnr,
    psnr_seen,
)

__all__ = ["DELTA", "DepthScores", "FrameScores", "depth_scores", "score"]


@dataclass(frozen=True, eq=False)
class FrameScores:
    """How one target turned out; None where the truth or the prediction is missing.

    Attributes:
        scene, target, contexts: names.
        confusion: pixels by true (rows) and predicted class, of those that have both.
        truth: pixels by true class, whatever was predicted there.
        psnr: over all pixels [dB]; infinite where the pictures are equal.
        ssim, lpips: of the pictures.
        depth: of the depth map.
        unseen: share of the pixels where the method saw nothing.
        miou_seen, accuracy_seen, psnr_seen, depth_seen: mean IoU, accuracy, PSNR and depth over the other pixels alone; None also
            where the method does not say what it saw.
        seconds_encode, seconds_render: wall-clock.
    """

    scene: str
    target: str
    contexts: tuple[str, ...]
    confusion: Int64[np.ndarray, "class class"] | None = None
    truth: Int64[np.ndarray, " class"] | None = None
    psnr: float | None = None
    ssim: float | None = None
    lpips: float | None = None
    depth: DepthScores | None = None
    unseen: float | None = None
    seconds_encode: float | None = None
    seconds_render: float | None = None
    miou_seen: float | None = None
    accuracy_seen: float | None = None
    psnr_seen: float | None = None
    depth_seen: DepthScores | None = None


def score(
    task: Task, prediction: Prediction, truth: Views, perceptual: PerceptualDistance | None = None
) -> FrameScores:
    """Compare a prediction with what the target's camera saw.

    Classes are compared at every pixel with a true label, seen or not; a pixel for which no class is given (255) enters
    no confusion matrix.

    Args:
        task: whose target it is.
        prediction: at the size of the evaluation.
        truth: one view, at that size.
        perceptual: LPIPS, where there is one.
    """
    confusion = counts = None
    if truth.labels is not None:
        labels = truth.labels[0]
        counts = np.bincount(labels[labels != IGNORE].numpy(), minlength=len(truth.classes)).astype(np.int64)
        if prediction.labels is not None:
            confusion = confusion_matrix(prediction.labels, labels, len(truth.classes)).numpy()
    image, photo = prediction.image, truth.images[0]
    found = FrameScores(
        scene=task.scene.name,
        target=task.target,
        contexts=task.contexts,
        confusion=confusion,
        truth=counts,
        psnr=None if image is None else float(psnr(image.double(), photo.double())),
        ssim=None if image is None else ssim(image, photo),
        lpips=None if image is None or perceptual is None else perceptual(image, photo),
        depth=None
        if prediction.depths is None or truth.depths is None
        else depth_scores(prediction.depths, truth.depths[0]),
        unseen=None if prediction.unseen is None else float(prediction.unseen.double().mean()),
        seconds_encode=prediction.seconds_encode,
        seconds_render=prediction.seconds_render,
    )
    return (
        found if prediction.unseen is None else replace(found, **_over_the_seen(prediction, truth, ~prediction.unseen))
    )


def _over_the_seen(prediction: Prediction, truth: Views, seen: Bool[Tensor, "h w"]) -> dict[str, Any]:
    """The scores over the pixels that a method saw, by their names in `FrameScores`."""
    found: dict[str, Any] = {}
    if prediction.labels is not None and truth.labels is not None:
        labels = truth.labels[0].masked_fill(~seen, IGNORE)
        present = present_classes(labels, len(truth.classes))
        if present.any():
            confusion = confusion_matrix(prediction.labels, labels, len(truth.classes))
            found |= {"miou_seen": float(miou(confusion, present)), "accuracy_seen": float(accuracy(confusion))}
    if (
        prediction.image is not None
        and (ratio := psnr_seen(prediction.image.double(), truth.images[0].double(), seen)) is not None
    ):
        found["psnr_seen"] = float(ratio)
    if prediction.depths is not None and truth.depths is not None:
        found["depth_seen"] = depth_scores(prediction.depths, truth.depths[0], seen)
    return found
