"""Validation: the averaged weights on rooms that no training sees."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
import torch

from semgs.data.views import Batch
from semgs.objectives.metrics import accuracy, confusion_matrix, miou, psnr
from semgs.rendering.rendering import likeliest
from semgs.training.objective import render_targets
from semgs.training.pictures import class_strip, strip

PICTURED = 4
"""Scenes in the strip of pictures."""


@dataclass(frozen=True)
class Validation:
    """What the fixed rooms say.

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


@torch.no_grad()
def validate(model: Any, batches: Sequence[Batch], supervision: str = "rendered") -> Validation:
    """Encode and render each batch and compare its target views; with supervision by labels or pictures, the classes of the input views alone."""
    decibels: list[torch.Tensor] = []
    confusion = None
    rows: list[np.ndarray] = []
    for batch in batches:
        if supervision != "rendered":
            target = batch.context
            semantics = model.classify(target, supervision == "pictures")
            row = class_strip(semantics, target)
        else:
            rendering, target = render_targets(model(batch.context), batch)
            decibels.append(psnr(rendering.images, target.images).flatten())
            semantics, row = rendering.semantics, strip(rendering, target)
        if semantics is not None and target.labels is not None:
            counts = confusion_matrix(likeliest(semantics), target.labels, len(target.classes))
            confusion = counts if confusion is None else confusion + counts
        if len(rows) < PICTURED:
            rows.append(row)
    return Validation(
        psnr=float(torch.cat(decibels).mean()) if decibels else float("nan"),
        miou=None if confusion is None or not confusion.any() else float(miou(confusion)),
        accuracy=None if confusion is None or not confusion.any() else float(accuracy(confusion)),
        pictures=np.concatenate(rows) if rows else None,
    )
