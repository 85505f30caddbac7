"""The strip of pictures that a validation leaves: what was rendered, and beside it what should have been."""

from __future__ import annotations

import numpy as np
import torch
from jaxtyping import Float, UInt8
from torch import Tensor

from semgs.data.classes import IGNORE, ClassTable
from semgs.data.views import Views
from semgs.rendering.rendering import Rendering


def strip(rendering: Rendering, target: Views) -> UInt8[np.ndarray, "h w 3"]:
    """The first target view in a row: image, truth, classes, truth, depth, truth; the truth is left out where unknown.

    Nearer is lighter; black is unknown, ignored or unseen (alpha below a half).
    """
    image, truth = (_first(images, 3) for images in (rendering.images, target.images))
    seen = _first(rendering.alphas, 2) >= 0.5
    near, far = target.depth_range.flatten(end_dim=-2)[0].tolist()
    panels = [_picture(image), _picture(truth)]
    if rendering.semantics is not None:
        classes = _first(rendering.semantics, 3).argmax(0)
        panels.append(_class_picture(torch.where(seen, classes, IGNORE), target.classes))
    if target.labels is not None:
        panels.append(_class_picture(_first(target.labels, 2), target.classes))
    panels.append(_depth_picture(_first(rendering.depths, 2) * seen, near, far))
    if target.depths is not None:
        panels.append(_depth_picture(_first(target.depths, 2), near, far))
    return np.concatenate(panels, axis=1)


def _first(maps: Tensor, axes: int) -> Tensor:
    """The first element over all leading axes but the last `axes`."""
    return maps.detach().cpu().flatten(end_dim=-axes - 1)[0]


def _picture(image: Float[Tensor, "3 h w"]) -> UInt8[np.ndarray, "h w 3"]:
    """An image in 0..1 as bytes."""
    return (image.clamp(0, 1) * 255).round().to(torch.uint8).permute(1, 2, 0).numpy()


def _class_picture(labels: Tensor, table: ClassTable) -> UInt8[np.ndarray, "h w 3"]:
    """Labels in the colours of their table, ignored ones black."""
    colours = np.zeros((IGNORE + 1, 3), dtype=np.uint8)
    colours[: len(table)] = table.colours
    return colours[labels.numpy()]


def _depth_picture(depths: Float[Tensor, "h w"], near: float, far: float) -> UInt8[np.ndarray, "h w 3"]:
    """Depths in grey, uniform in log depth from near (light) to far (dark), unknown ones black."""
    span = torch.log(torch.tensor(far / near))
    grey = 1 - 0.9 * (depths.clamp(near, far) / near).log() / span
    return _picture(torch.where(depths > 0, grey, 0).expand(3, *depths.shape))
