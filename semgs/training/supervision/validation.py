"""Validation: scores of the averaged weights on scenes that are not trained on, and strips of images that show each rendered one next to the true one."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
import torch
from jaxtyping import Float, UInt8
from torch import Tensor

from semgs.data.views import Batch, Views
from semgs.figures.class_images import class_picture, true_class_picture
from semgs.files.images.colours import depth_limits, depth_picture
from semgs.objectives.metrics import accuracy, confusion_matrix, depth_scores, miou
from semgs.rendering.rendering import Rendering, label_maps, likeliest

PICTURED = 4
"""Scenes in the strip of images."""


@dataclass(frozen=True)
class Validation:
    """What a validation found.

    Attributes:
        score: decides which checkpoint is the best; higher is better, NaN if nothing was measured.
        numbers: for the log, by name.
        phrases: for the console, one for each number that was measured.
        pictures: a row of images for each of the first scenes; uint8 [h w 3]; None without scenes.
    """

    score: float
    numbers: Mapping[str, float | None]
    phrases: tuple[str, ...]
    pictures: np.ndarray | None


def validation_of_views(
    psnr: float, miou: float | None, accuracy: float | None, pictures: np.ndarray | None
) -> Validation:
    """Scores of views and their classes. The score that counts is mean IoU, or PSNR without classes.

    Args:
        psnr: mean over target views [dB]; NaN if nothing was rendered.
        miou: of all target pixels, from one confusion matrix; None without classes or labels.
        accuracy: share of labelled target pixels with the right class; None without classes or labels.
        pictures: columns image, truth, classes, truth, depth, truth.
    """
    rendered = [f"PSNR {psnr:.2f} dB"] if math.isfinite(psnr) else []
    classes = [] if miou is None else [f"mIoU {miou:.3f}", f"accuracy {accuracy:.3f}"]
    numbers = {"psnr": psnr, "miou": miou, "accuracy": accuracy}
    return Validation(psnr if miou is None else miou, numbers, (*rendered, *classes), pictures)


def validation_of_depth(abs_rel: float, delta_125: float, pictures: np.ndarray | None) -> Validation:
    """Scores of the depth of input views. The score that counts is minus the relative error.

    Args:
        abs_rel: mean of |z - truth| / truth over all pixels with true depth; NaN if there are none.
        delta_125: share of those pixels within a factor of 1.25 of the truth; likewise.
        pictures: columns image, depth, truth.
    """
    numbers = {"depth_abs_rel": abs_rel, "depth_delta_125": delta_125}
    return Validation(-abs_rel, numbers, (f"AbsRel {abs_rel:.4f}", f"delta < 1.25 {delta_125:.3f}"), pictures)


@dataclass(frozen=True)
class Comparison:
    """Predicted and true views of one batch.

    Attributes:
        target: the true views, on any device.
        semantics: class distributions of their pixels, on any device; None without classes.
        row: images of the first view; uint8 [h w 3].
        psnr: of each view [dB]; None if nothing was rendered.
    """

    target: Views
    semantics: Float[Tensor, "*batch v class h w"] | None
    row: np.ndarray
    psnr: Float[Tensor, "*batch v"] | None = None


@torch.no_grad()
def validate(model: Any, batches: Iterable[Batch], compare: Callable[[Any, Batch], Comparison]) -> Validation:
    """Compare each batch with the truth, and score all batches together.

    Args:
        model: the network, in evaluation mode.
        batches: of validation.
        compare: compares one batch.
    """
    decibels: list[Tensor] = []
    confusion = None
    rows: list[np.ndarray] = []
    for batch in batches:
        comparison = compare(model, batch)
        if comparison.psnr is not None:
            decibels.append(comparison.psnr.flatten())
        if comparison.semantics is not None and comparison.target.labels is not None:
            labels = comparison.target.labels.cpu()
            counts = confusion_matrix(likeliest(comparison.semantics).cpu(), labels, len(comparison.target.classes))
            confusion = counts if confusion is None else confusion + counts
        if len(rows) < PICTURED:
            rows.append(comparison.row)
    mean_iou = share = None
    if confusion is not None and confusion.any():
        mean_iou, share = float(miou(confusion)), float(accuracy(confusion))
    return validation_of_views(
        float(torch.cat(decibels).mean()) if decibels else math.nan,
        mean_iou,
        share,
        np.concatenate(rows) if rows else None,
    )


@torch.no_grad()
def validate_depth(model: Any, batches: Iterable[Batch]) -> Validation:
    """Score the plane sweep's depth of the input views, after convex upsampling if there is one, over the pixels of all batches together.

    Args:
        model: the network, in evaluation mode.
        batches: of validation.
    """
    predicted: list[Tensor] = []
    truth: list[Tensor] = []
    rows: list[np.ndarray] = []
    for views in (batch.context for batch in batches):
        swept = model.sweep(views)
        depths = (swept.depths if swept.finer is None else swept.finer.mode).cpu()
        if views.depths is not None:
            predicted.append(depths.flatten(end_dim=-2))
            truth.append(views.depths.cpu().flatten(end_dim=-2))
        if len(rows) < PICTURED:
            rows.append(depth_strip(depths, views))
    scores = depth_scores(torch.cat(predicted), torch.cat(truth)) if predicted else None
    errors = (math.nan, math.nan) if scores is None else (scores.abs_rel, scores.delta)
    return validation_of_depth(*errors, np.concatenate(rows) if rows else None)


def strip(rendering: Rendering, target: Views) -> UInt8[np.ndarray, "h w 3"]:
    """The first target view in one row: image, truth, classes, truth, depth, truth; what is missing is left out.

    Unseen areas of the class map are hatched. Both depths are coloured by the range of the true one.
    """
    first = _first_view(rendering)
    panels = [_picture(_first(first.images, 3)), _picture(_first(target.images, 3))]
    if first.semantics is not None:
        panels.append(class_picture(label_maps(first)[0], target.classes))
    if target.labels is not None:
        panels.append(true_class_picture(_first(target.labels, 2), target.classes))
    return np.concatenate([*panels, *_depth_panels(first.depths, target)], axis=1)


def class_strip(distributions: Float[Tensor, "*batch v class h w"], views: Views) -> UInt8[np.ndarray, "h w_all 3"]:
    """The first view in one row: image, classes, truth if there is one; for distributions that were not rendered."""
    classes = _first(distributions, 3).argmax(0).astype(np.uint8)
    panels = [_picture(_first(views.images, 3)), class_picture(classes, views.classes)]
    if views.labels is not None:
        panels.append(true_class_picture(_first(views.labels, 2), views.classes))
    return np.concatenate(panels, axis=1)


def depth_strip(depths: Float[Tensor, "*batch v h w"], views: Views) -> UInt8[np.ndarray, "h w_all 3"]:
    """The first view in one row: image, depth, truth if there is one; for depth that was not rendered."""
    return np.concatenate([_picture(_first(views.images, 3)), *_depth_panels(depths, views)], axis=1)


def _depth_panels(depths: Float[Tensor, "*batch v h w"], views: Views) -> list[UInt8[np.ndarray, "h w 3"]]:
    """The depth of the first view and the true one, if there is one, both coloured by the range of the true one."""
    maps = [_first(depth, 2) for depth in (depths, views.depths) if depth is not None]
    limits = depth_limits(maps[-1:])
    return [depth_picture(depth, limits) for depth in maps]


def _first_view(rendering: Rendering) -> Rendering:
    """The first view of the first scene, without batch axes."""
    first = (0,) * (rendering.depths.ndim - 3)
    semantics = None if rendering.semantics is None else rendering.semantics[first][:1]
    return Rendering(rendering.images[first][:1], semantics, rendering.depths[first][:1], rendering.alphas[first][:1])


def _first(maps: Tensor, axes: int) -> np.ndarray:
    """The first map, without any but its last `axes` axes."""
    return maps.detach().cpu().flatten(end_dim=-axes - 1)[0].numpy()


def _picture(image: np.ndarray) -> UInt8[np.ndarray, "h w 3"]:
    """An image [3 h w] in 0..1 as bytes."""
    return np.rint(255 * image.clip(0, 1)).astype(np.uint8).transpose(1, 2, 0)
