"""Validation: the averaged weights on scenes that no training sees."""

from __future__ import annotations

import math
from abc import ABC, abstractmethod
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
import torch
from jaxtyping import Float
from torch import Tensor

from semgs.data.views import Batch, Views
from semgs.objectives.metrics import accuracy, confusion_matrix, depth_scores, miou
from semgs.rendering.rendering import likeliest
from semgs.training.pictures import depth_strip

PICTURED = 4
"""Scenes in the strip of pictures."""


class Verdict(ABC):
    """What a validation found, whatever it measured.

    Attributes:
        pictures: a row for each of the first scenes; uint8 [h w 3]; None without scenes.
    """

    pictures: np.ndarray | None

    @property
    @abstractmethod
    def score(self) -> float:
        """Decides which checkpoint is kept as the best: higher is better; not a number if nothing was measured."""

    @property
    @abstractmethod
    def numbers(self) -> dict[str, float | None]:
        """What the log gets, by name."""

    @property
    @abstractmethod
    def told(self) -> list[str]:
        """What the console gets, a phrase for each number."""


@dataclass(frozen=True)
class Validation(Verdict):
    """How well views and their classes agree with the truth.

    Attributes:
        psnr: mean over target views [dB]; not a number where nothing was rendered.
        miou: of all target pixels, from one confusion matrix; None without classes or labels.
        accuracy: share of labelled target pixels whose class is right; None without classes or labels.
        pictures: rows of scenes; columns image, truth, classes, truth, depth, truth; uint8 [h w 3]; None without scenes.
    """

    psnr: float
    miou: float | None
    accuracy: float | None
    pictures: np.ndarray | None

    @property
    def score(self) -> float:
        """Mean IoU, or PSNR where there are no classes."""
        return self.psnr if self.miou is None else self.miou

    @property
    def numbers(self) -> dict[str, float | None]:
        """PSNR, mean IoU and accuracy."""
        return {"psnr": self.psnr, "miou": self.miou, "accuracy": self.accuracy}

    @property
    def told(self) -> list[str]:
        """Those of the numbers that there are."""
        rendered = [f"PSNR {self.psnr:.2f} dB"] if math.isfinite(self.psnr) else []
        return rendered + ([] if self.miou is None else [f"mIoU {self.miou:.3f}", f"accuracy {self.accuracy:.3f}"])


@dataclass(frozen=True)
class DepthValidation(Verdict):
    """How well the depth of input views agrees with the truth.

    Attributes:
        abs_rel: mean of |z - truth| / truth over all pixels with true depth; not a number if there are none.
        delta_125: share of those pixels that are within a factor of 1.25 of the truth; likewise.
        pictures: rows of scenes; columns image, depth, truth; uint8 [h w 3]; None without scenes.
    """

    abs_rel: float
    delta_125: float
    pictures: np.ndarray | None

    @property
    def score(self) -> float:
        """Minus the relative error."""
        return -self.abs_rel

    @property
    def numbers(self) -> dict[str, float | None]:
        """By the names that they have in reports of evaluation."""
        return {"depth_abs_rel": self.abs_rel, "depth_delta_125": self.delta_125}

    @property
    def told(self) -> list[str]:
        """Both numbers."""
        return [f"AbsRel {self.abs_rel:.4f}", f"delta < 1.25 {self.delta_125:.3f}"]


@dataclass(frozen=True)
class Comparison:
    """Views of one batch next to the truth.

    Attributes:
        target: the true views, on any device.
        semantics: class distributions of their pixels, on any device; None without classes.
        row: pictures of the first view; uint8 [h w 3].
        psnr: of each view [dB]; None where nothing was rendered.
    """

    target: Views
    semantics: Float[Tensor, "*batch v class h w"] | None
    row: np.ndarray
    psnr: Float[Tensor, "*batch v"] | None = None


@torch.no_grad()
def validate(model: Any, batches: Sequence[Batch], compare: Callable[[Any, Batch], Comparison]) -> Validation:
    """Compare each batch, and score all of them together.

    Args:
        model: the network, in evaluation mode.
        batches: of validation.
        compare: of the network and a batch.
    """
    decibels: list[Tensor] = []
    confusion = None
    rows: list[np.ndarray] = []
    for batch in batches:
        found = compare(model, batch)
        if found.psnr is not None:
            decibels.append(found.psnr.flatten())
        if found.semantics is not None and found.target.labels is not None:
            labels = found.target.labels.cpu()
            counts = confusion_matrix(likeliest(found.semantics).cpu(), labels, len(found.target.classes))
            confusion = counts if confusion is None else confusion + counts
        if len(rows) < PICTURED:
            rows.append(found.row)
    return Validation(
        psnr=float(torch.cat(decibels).mean()) if decibels else float("nan"),
        miou=None if confusion is None or not confusion.any() else float(miou(confusion)),
        accuracy=None if confusion is None or not confusion.any() else float(accuracy(confusion)),
        pictures=np.concatenate(rows) if rows else None,
    )


@torch.no_grad()
def validate_depth(model: Any, batches: Sequence[Batch]) -> DepthValidation:
    """Compare the depth that the plane sweep finds in the input views with the truth, all pixels together.

    Args:
        model: the network, in evaluation mode.
        batches: of validation.
    """
    found: list[Tensor] = []
    truth: list[Tensor] = []
    rows: list[np.ndarray] = []
    for views in (batch.context for batch in batches):
        depths = model.sweep(views).depths.cpu()
        if views.depths is not None:
            found.append(depths.flatten(end_dim=-2))
            truth.append(views.depths.cpu().flatten(end_dim=-2))
        if len(rows) < PICTURED:
            rows.append(depth_strip(depths, views))
    scores = depth_scores(torch.cat(found), torch.cat(truth)) if found else None
    return DepthValidation(
        abs_rel=float("nan") if scores is None else scores.abs_rel,
        delta_125=float("nan") if scores is None else scores.delta,
        pictures=np.concatenate(rows) if rows else None,
    )
