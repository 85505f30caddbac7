"""Scores of one target, from which all summaries are computed.

Beside the usual ones: SSIM, LPIPS if the user has installed it, and what a visitor sees who steps aside: edges, sharpness, what is made up where no input view looked,
and what floats in front.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, replace

import numpy as np
import torch
from jaxtyping import Bool, Float, Int64, UInt8
from torch import Tensor
from torch.nn.functional import max_pool2d

from semgs.data.tables.class_groups import ClassGroups
from semgs.data.tables.classes import IGNORE
from semgs.data.views import Views
from semgs.evaluation.frames.frame_plan import Task
from semgs.evaluation.frames.free_space import FreeSpace
from semgs.evaluation.frames.predictions import Prediction
from semgs.evaluation.scoring.panoptic import Segments
from semgs.objectives.metrics import Maps, ViewScores, psnr_seen, view_scores
from semgs.objectives.selective import counts_by_confidence

CHANGED = 1.1
"""Two depths of a pixel differ if one is so many times the other."""

STEP = 1.1
"""Depth steps between two neighbouring pixels if one is so many times as far as the other."""

EDGE_PX = 6
"""Edges are the pixels so near to a depth step, along rows and columns [px]."""

FLYER = 1.25
"""What is drawn floats if the true depth is more than so many times as far."""


@dataclass(frozen=True, eq=False)
class FrameScores(ViewScores):
    """The scores of one target; None if the truth or the prediction is missing.

    Attributes:
        scene, target, contexts: names.
        truth: number of pixels by true class.
        ssim, lpips: of the images.
        seconds_encode, seconds_render: wall-clock.
        confidences: the labelled and seen pixels by their confidence, as `semgs.objectives.selective` counts them.
        merged, merged_truth: `confusion` and `truth` by groups of classes; not saved, and None unless requested.
        free_space: of the map of the input views; None unless requested.
        more: scores that only some targets have, by metric: those of `changes` and of `aside_scores`.
        segments: the segments that truth and prediction share; None unless requested.
        boxes: the numbers of `semgs.evaluation.scoring.panoptic.count_boxes`; None unless requested.
        hidden: pixels that count in none of them; not saved.
        fragments: share of the predicted class map in tiny regions (`paper.ablate.fragments`); not saved, and None unless requested.
    """

    scene: str
    target: str
    contexts: tuple[str, ...]
    truth: Int64[np.ndarray, " class"] | None = None
    ssim: float | None = None
    lpips: float | None = None
    seconds_encode: float | None = None
    seconds_render: float | None = None
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
    scores = view_scores(
        given, true, len(truth.classes), None if truth.hidden is None else truth.hidden[0], prediction.unseen
    )
    return FrameScores(
        **vars(scores),
        scene=task.scene.name,
        target=task.target,
        contexts=task.contexts,
        truth=counts,
        ssim=None if image is None else ssim(image, photo, shown),
        lpips=None if image is None or perceptual is None else perceptual(image, photo),
        seconds_encode=prediction.seconds_encode,
        seconds_render=prediction.seconds_render,
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


def near_steps(depths: Float[Tensor, "h w"]) -> Bool[Tensor, "h w"]:
    """The pixels at most `EDGE_PX` from a pixel beside a depth step; next to unknown depth (0) there is none."""
    steps = torch.zeros(depths.shape, dtype=torch.bool)
    for one, other in (((slice(None), slice(1, None)), (slice(None), slice(-1))), ((slice(1, None),), (slice(-1),))):
        near, far = torch.minimum(depths[one], depths[other]), torch.maximum(depths[one], depths[other])
        jump = (near > 0) & (far > STEP * near)
        steps[one] |= jump
        steps[other] |= jump
    side = 2 * EDGE_PX + 1
    return max_pool2d(steps[None].float(), side, stride=1, padding=EDGE_PX)[0] > 0


def psnr_gradients(image: Float[Tensor, "3 h w"], truth: Float[Tensor, "3 h w"]) -> float | None:
    """PSNR of the differences between neighbours, along rows and columns together [dB]; None for equal ones."""
    wrong = [(image.double().diff(dim=axis) - truth.double().diff(dim=axis)).square() for axis in (1, 2)]
    mean = torch.cat([one.flatten() for one in wrong]).mean()
    return float(-10 * mean.log10()) if mean > 0 else None


def aside_scores(prediction: Prediction, truth: Views, unseen: Bool[Tensor, "h w"] | None) -> dict[str, float]:
    """Compare a prediction with a true view.

    Args:
        prediction: of the view.
        truth: the view alone.
        unseen: the pixels that no input view sees, by true depth; None if it is unknown.

    Returns:
        psnr_edges: at edges [dB].
        depth_edges: mean of |z - truth| / truth there.
        psnr_gradients: PSNR of horizontal and vertical differences of neighbouring pixels [dB]: noise lowers it, as blur does.
        made_up: share of the pixels that no input view sees which the method draws.
        flyers: share of the pixels that the method draws which float in front.
        Without those of which the truth or the prediction is missing, or no pixel counts.
    """
    image, depths, drawn = prediction.image, prediction.depths, prediction.unseen
    drawn = None if drawn is None else ~drawn
    true_depths = None if truth.depths is None else truth.depths[0]
    found: dict[str, float | None] = {}
    if image is not None:
        found["psnr_gradients"] = psnr_gradients(image, truth.images[0])
    if true_depths is not None:
        known, edges = true_depths > 0, near_steps(true_depths)
        if image is not None and edges.any():
            ratio = psnr_seen(image.double(), truth.images[0].double(), edges)
            found["psnr_edges"] = None if ratio is None else float(ratio)
        if depths is not None and (edges & known).any():
            wrong = (depths - true_depths).abs() / true_depths
            found["depth_edges"] = float(wrong[edges & known].double().mean())
        if drawn is not None and unseen is not None and (unseen & known).any():
            found["made_up"] = float(drawn[unseen & known].double().mean())
        if drawn is not None and depths is not None and (drawn & known).any():
            found["flyers"] = float((FLYER * depths < true_depths)[drawn & known].double().mean())
    return {name: value for name, value in found.items() if value is not None}


def ssim(
    image: Float[Tensor, "3 h w"], truth: Float[Tensor, "3 h w"], shown: Bool[Tensor, "h w"] | None = None
) -> float:
    """Structural similarity (Wang et al. 2004) by torchmetrics; the image is clamped to 0..1.

    Gaussian window of 11x11 pixels with standard deviation 1.5, K1 = 0.01, K2 = 0.03. Mean over the windows around all pixels,
    mirrored at the border, and over the three channels.

    Args:
        image, truth: to compare.
        shown: pixels whose windows count; None is all.
    """
    from torchmetrics.functional.image import structural_similarity_index_measure  # takes seconds to import

    images = image.clamp(0, 1)[None], truth[None]
    if shown is not None:
        _, maps = structural_similarity_index_measure(*images, data_range=1.0, return_full_image=True)
        return float(maps[0][:, shown].mean())
    value = structural_similarity_index_measure(*images, data_range=1.0)
    assert isinstance(value, Tensor)
    return float(value)


class PerceptualDistance:
    """LPIPS with VGG features, as pixelSplat and MVSplat report it.

    The package `lpips` is in none of our extras: it needs torchvision, and downloads its own weights on first use.

    Raises:
        ImportError: it is not installed.
        OSError: its weights cannot be downloaded.
    """

    def __init__(self) -> None:
        import lpips

        self._network = lpips.LPIPS(net="vgg", verbose=False).eval()

    @torch.no_grad()
    def __call__(self, image: Float[Tensor, "3 h w"], truth: Float[Tensor, "3 h w"]) -> float:
        """The distance of an image, clamped to 0..1, from the true one; 0 if they are equal."""
        return float(self._network(image.clamp(0, 1)[None], truth[None], normalize=True))


def perceptual_distance() -> PerceptualDistance | None:
    """LPIPS if it is installed with its weights, else None."""
    try:
        return PerceptualDistance()
    except (ImportError, OSError):
        return None
