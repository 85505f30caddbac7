"""Scores of one target: everything that is counted or measured there, from which all summaries are made."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from jaxtyping import Int64

from semgs.data.classes import IGNORE
from semgs.data.views import Views
from semgs.evaluation.plan import Task
from semgs.evaluation.predictions import Prediction
from semgs.evaluation.similarity import PerceptualDistance, ssim
from semgs.objectives.metrics import DELTA, DepthScores, confusion_matrix, depth_scores, psnr

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
    image, seen = prediction.image, truth.images[0]
    return FrameScores(
        scene=task.scene.name,
        target=task.target,
        contexts=task.contexts,
        confusion=confusion,
        truth=counts,
        psnr=None if image is None else float(psnr(image.double(), seen.double())),
        ssim=None if image is None else ssim(image, seen),
        lpips=None if image is None or perceptual is None else perceptual(image, seen),
        depth=None
        if prediction.depths is None or truth.depths is None
        else depth_scores(prediction.depths, truth.depths[0]),
        unseen=None if prediction.unseen is None else float(prediction.unseen.double().mean()),
        seconds_encode=prediction.seconds_encode,
        seconds_render=prediction.seconds_render,
    )
