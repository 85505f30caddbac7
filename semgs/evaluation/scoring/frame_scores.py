"""Scores of one target, from which all summaries are computed."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, replace

import numpy as np
import torch
from jaxtyping import Int64, UInt8
from torch import Tensor

from semgs.data.tables.class_groups import ClassGroups
from semgs.data.tables.classes import IGNORE
from semgs.data.views import Views
from semgs.evaluation.frames.frame_plan import Task
from semgs.evaluation.frames.free_space import FreeSpace
from semgs.evaluation.frames.predictions import Prediction
from semgs.evaluation.scoring.panoptic import Segments
from semgs.evaluation.scoring.similarity import PerceptualDistance, ssim
from semgs.objectives.map_scores import Maps, MapScores, map_scores
from semgs.objectives.metrics import DepthScores
from semgs.objectives.selective import counts_by_confidence

CHANGED = 1.1
"""Two depths of a pixel differ if one is so many times the other."""


@dataclass(frozen=True, eq=False)
class FrameScores:
    """The scores of one target; None if the truth or the prediction is missing.

    Attributes:
        scene, target, contexts: names.
        confusion: number of pixels by true (rows) and predicted class, where both are known.
        truth: number of pixels by true class.
        psnr: over all pixels [dB]; infinite for equal images.
        ssim, lpips: of the images.
        depth: of the depth map.
        unseen: share of the pixels where the method saw nothing.
        miou_seen, accuracy_seen, psnr_seen, depth_seen: mean IoU, accuracy, PSNR and depth over the seen pixels; None also if
            the method does not say what it saw.
        seconds_encode, seconds_render: wall-clock.
        confidences: the labelled and seen pixels by their confidence, as `semgs.objectives.selective` counts them.
        merged, merged_truth: `confusion` and `truth` by groups of classes; not saved, and None unless requested.
        free_space: of the map of the input views; None unless requested.
        more: scores that only some targets have, by metric: those of `changes`, and of `semgs.evaluation.scoring.aside_scores`.
        segments: the segments that truth and prediction share; None unless requested.
        boxes: the numbers of `semgs.evaluation.scoring.panoptic.count_boxes`; None unless requested.
        hidden: pixels that count in none of them; not saved.
        fragments: share of the predicted class map in tiny regions (`paper.ablate.fragments`); not saved, and None unless requested.
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
    confidences: Int64[np.ndarray, "level 2"] | None = None
    hidden: int = 0
    fragments: float | None = None
    merged: Int64[np.ndarray, "group group"] | None = None
    merged_truth: Int64[np.ndarray, " group"] | None = None
    free_space: FreeSpace | None = None
    more: Mapping[str, float] = field(default_factory=dict)
    segments: Segments | None = None
    boxes: tuple[int, ...] | None = None

    def by_groups(self, groups: ClassGroups) -> FrameScores:
        """The same, with counts by groups of classes."""
        if self.confusion is None or self.truth is None:
            return self
        return replace(self, merged=groups.merged(self.confusion), merged_truth=groups.merged(self.truth))


def score(
    task: Task, prediction: Prediction, truth: Views, perceptual: PerceptualDistance | None = None
) -> FrameScores:
    """Compare a prediction with the true view.

    Classes are compared at every pixel with a true label, seen or not. Pixels without a predicted class (255) are left out of
    the confusion matrix. Hidden pixels of the true view count in no score; LPIPS, which has no pixels, takes them as predicted without error.

    Args:
        task: of the target.
        prediction: at the size of the evaluation.
        truth: one view of the same size.
        perceptual: LPIPS, if available.
    """
    labels = None if truth.labels is None else truth.labels[0]
    counts = None
    if labels is not None:
        counts = np.bincount(labels[labels != IGNORE].numpy(), minlength=len(truth.classes)).astype(np.int64)
    image, photo = prediction.image, truth.images[0]
    given = Maps(None if image is None else image.double(), prediction.labels, prediction.depths)
    true = Maps(photo.double(), labels, None if truth.depths is None else truth.depths[0])
    shown = None if truth.hidden is None else ~truth.hidden[0]
    if image is not None and shown is not None:
        image = torch.where(shown, image, photo.to(image))
    whole = map_scores(given, true, len(truth.classes), shown)
    part, unseen = MapScores(), prediction.unseen
    if unseen is not None:
        part = map_scores(given, true, len(truth.classes), ~unseen if shown is None else shown & ~unseen)
        unseen = unseen if shown is None else unseen[shown]
    return FrameScores(
        scene=task.scene.name,
        target=task.target,
        contexts=task.contexts,
        confusion=None if whole.confusion is None else whole.confusion.numpy(),
        truth=counts,
        psnr=whole.psnr,
        ssim=None if image is None else ssim(image, photo, shown),
        lpips=None if image is None or perceptual is None else perceptual(image, photo),
        depth=whole.depth,
        unseen=None if unseen is None else float(unseen.double().mean()),
        seconds_encode=prediction.seconds_encode,
        seconds_render=prediction.seconds_render,
        miou_seen=part.miou,
        accuracy_seen=part.accuracy,
        psnr_seen=part.psnr,
        depth_seen=part.depth,
        confidences=None if labels is None else _confidences(prediction, labels),
        free_space=prediction.free_space,
        hidden=0 if truth.hidden is None else int(truth.hidden.sum()),
    )


def changes(one: Prediction, other: Prediction) -> dict[str, float]:
    """How much of what both predictions see differs between them.

    Returns:
        changed_classes: share of the pixels with another class.
        changed_depth: share of the pixels of which one depth is over `CHANGED` times the other.
        Without the one that a prediction lacks, or of which no pixel is seen in both.
    """
    seen = torch.tensor(True)
    for part in (one, other):
        seen = seen if part.unseen is None else seen & ~part.unseen
    found: dict[str, float] = {}
    if one.labels is not None and other.labels is not None and seen.any():
        found["changed_classes"] = float((one.labels != other.labels)[seen.expand(one.labels.shape)].double().mean())
    if one.depths is not None and other.depths is not None:
        near, far = torch.minimum(one.depths, other.depths), torch.maximum(one.depths, other.depths)
        if (counted := seen & (near > 0)).any():
            found["changed_depth"] = float((far > CHANGED * near)[counted].double().mean())
    return found


def _confidences(prediction: Prediction, labels: UInt8[Tensor, "h w"]) -> Int64[np.ndarray, "level 2"] | None:
    """The labelled and seen pixels by their confidence; None if there is none."""
    if prediction.confidences is None or prediction.labels is None:
        return None
    counted = (labels != IGNORE) & (prediction.confidences > 0)
    return counts_by_confidence(prediction.confidences[counted], (prediction.labels == labels)[counted])
