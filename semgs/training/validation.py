"""Validation: the averaged weights on rooms that no training sees."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import torch
from torch import nn

from semgs.data.views import Batch
from semgs.objectives.metrics import accuracy, confusion_matrix, miou, psnr
from semgs.training.objective import render_targets
from semgs.training.pictures import strip

PICTURED = 4
"""Scenes in the strip of pictures."""


@dataclass(frozen=True)
class Validation:
    """What the fixed rooms say.

    Attributes:
        psnr: mean over target views [dB].
        miou: of all target pixels, from one confusion matrix; None without classes or labels.
        accuracy: share of labelled target pixels whose class is right; None without classes or labels.
        pictures: rows of scenes; columns image, truth, classes, truth, depth, truth; uint8 [h w 3]; None without scenes.
    """

    psnr: float
    miou: float | None
    accuracy: float | None
    pictures: np.ndarray | None


@torch.no_grad()
def validate(model: nn.Module, batches: Sequence[Batch]) -> Validation:
    """Encode and render each batch and compare its target views."""
    decibels: list[torch.Tensor] = []
    confusion = None
    rows: list[np.ndarray] = []
    for batch in batches:
        rendering, target = render_targets(model(batch.context), batch)
        decibels.append(psnr(rendering.images, target.images).flatten())
        if rendering.semantics is not None and target.labels is not None:
            predicted = rendering.semantics.argmax(-3).to(torch.uint8)
            counts = confusion_matrix(predicted, target.labels, len(target.classes))
            confusion = counts if confusion is None else confusion + counts
        if len(rows) < PICTURED:
            rows.append(strip(rendering, target))
    return Validation(
        psnr=float(torch.cat(decibels).mean()) if decibels else float("nan"),
        miou=None if confusion is None or not confusion.any() else float(miou(confusion)),
        accuracy=None if confusion is None or not confusion.any() else float(accuracy(confusion)),
        pictures=np.concatenate(rows) if rows else None,
    )
