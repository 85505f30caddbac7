"""The images of one view, as the reports of reconstructions and evaluations show them."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from jaxtyping import Float, UInt8
from torch import Tensor

from semgs.data.tables.classes import ClassTable
from semgs.figures.class_images import class_picture, true_class_picture
from semgs.figures.html_page import Notes, Picture, Section
from semgs.figures.number_texts import percent
from semgs.files.images.colours import depth_picture, heat_picture


def as_bytes(image: Float[Tensor, "channel h w"]) -> UInt8[np.ndarray, "h w channel"]:
    """An image of 0..1 (clamped) as bytes, channels last."""
    return np.rint(255 * image.clamp(0, 1).permute(1, 2, 0).numpy()).astype(np.uint8)


def photo(image: Float[Tensor, "3 h w"], caption: str) -> Picture:
    """A photo or a render."""
    return Picture(as_bytes(image), caption, lossy=True)


def class_map(labels: UInt8[np.ndarray, "h w"], classes: ClassTable) -> Picture:
    """Predicted classes; pixels without a class are hatched."""
    return Picture(class_picture(labels, classes), "classes")


def true_class_map(labels: UInt8[Tensor, "h w"], classes: ClassTable) -> Picture:
    """True classes; unlabelled pixels are black."""
    return Picture(true_class_picture(labels.numpy(), classes), "true classes")


def depth_map(depths: Float[Tensor, "h w"], limits: tuple[float, float], caption: str = "depth") -> Picture:
    """z-depth in colours between two limits."""
    return Picture(depth_picture(depths.numpy(), limits), caption, lossy=True)


def heat_map(values: Float[np.ndarray, "h w"], most: float, name: str) -> Picture:
    """Shares in colours, from black at 0 to yellow at `most` or more; hatched where unseen (NaN)."""
    end = percent(most) + ("" if most >= 1 else " or more")
    return Picture(heat_picture(values, (0.0, most)), f"{name} (black 0 %, yellow {end})", lossy=True)


def please_note(sentences: Sequence[str]) -> list[Section]:
    """The section with important notes; none if there are no notes."""
    return [Section("Please note", "", (Notes(tuple(sentences)),))] if sentences else []
