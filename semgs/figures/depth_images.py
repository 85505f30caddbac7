"""Images of depth errors, and the scales of depth images."""

from __future__ import annotations

import cv2
import numpy as np
from jaxtyping import Float, UInt8
from torch import Tensor

from semgs.files.images.colours import NOTHING, depth_palette, opencv_palette

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
