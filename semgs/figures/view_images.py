"""The images of one view, as the reports of reconstructions and evaluations show them, with the scales of depth and the errors of it."""

from __future__ import annotations

from collections.abc import Sequence

import cv2
import numpy as np
from jaxtyping import Float, UInt8
from torch import Tensor

from semgs.data.tables.classes import ClassTable
from semgs.figures.class_images import class_picture, true_class_picture
from semgs.figures.html_page import Notes, Picture, Section
from semgs.files.images.colours import NOTHING, depth_palette, depth_picture, heat_picture, opencv_palette
from semgs.files.text import percent

MILLIMETRES = 1000
"""The value of one metre in a 16-bit depth image."""

WORST_ERROR = 0.25
"""The relative error at the end of the colour scale; larger errors have the same colour."""


def depth_error_picture(
    depths: Float[np.ndarray, "h w"], truth: Float[np.ndarray, "h w"]
) -> UInt8[np.ndarray, "h w 3"]:
    """|z - truth| / truth in colours, from black at 0 to light yellow at `WORST_ERROR` or more; grey without truth."""
    known = truth > 0
    error = np.abs(depths - truth) / np.where(known, truth, 1)
    coloured = _error_palette()[np.rint(255 * np.clip(error / WORST_ERROR, 0, 1)).astype(np.uint8)]
    return np.where(known[..., None], coloured, np.array(NOTHING, np.uint8))


def depth_error_bar() -> UInt8[np.ndarray, "1 256 3"]:
    """The colours of `depth_error_picture` from 0 (left) to `WORST_ERROR` (right)."""
    return _error_palette()[None]


def depth_ticks(limits: tuple[float, float], count: int) -> tuple[float, ...]:
    """The depths at evenly spaced places along `depth_bar`, including its ends."""
    return tuple(float(depth) for depth in np.geomspace(*limits, count))


def depth_bar() -> UInt8[np.ndarray, "1 256 3"]:
    """The colours of `depth_picture` from near (left) to far (right)."""
    return depth_palette()[None]


def _error_palette() -> UInt8[np.ndarray, "256 3"]:
    """Inferno, as bytes."""
    return opencv_palette(cv2.COLORMAP_INFERNO)


def millimetres(depths: Float[Tensor, "h w"]) -> np.ndarray:
    """z-depths in metres as uint16 millimetres [h w]; 0 for no depth, and for depths that do not fit."""
    scaled = np.rint(MILLIMETRES * depths.double().numpy())
    return np.where((scaled > 0) & (scaled <= np.iinfo(np.uint16).max), scaled, 0).astype(np.uint16)


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
