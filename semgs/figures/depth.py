"""Depth maps as pictures, and the scale they are read by."""

from __future__ import annotations

from collections.abc import Iterable

import cv2
import numpy as np
from jaxtyping import Float, UInt8

NOTHING = (40, 42, 46)
"""The grey of pixels without depth."""

WORST_ERROR = 0.25
"""The relative error from which pictures of errors have one colour."""


def depth_limits(maps: Iterable[np.ndarray]) -> tuple[float, float]:
    """The depths that the colours of several maps should span: the 1st to the 99th percentile of what has depth (> 0).

    Maps without any depth give (1, 10).
    """
    drawn = np.concatenate([np.zeros(0), *(depths[depths > 0].ravel() for depths in maps)])
    if not drawn.size:
        return 1.0, 10.0
    low, high = (float(limit) for limit in np.percentile(drawn, (1, 99)))
    return (low, high) if high > low else (low * 0.95, low * 1.05)


def depth_picture(depths: Float[np.ndarray, "h w"], limits: tuple[float, float]) -> UInt8[np.ndarray, "h w 3"]:
    """Depths in colours (turbo, near is red), even in their logarithm between the limits; grey where there is none.

    Even in the logarithm, because a room's far end would otherwise leave no colours for what stands in front of it.
    """
    low, high = limits
    steps = np.log(np.clip(depths, low, high) / low) / np.log(high / low)
    coloured = _palette()[np.rint(255 * steps).astype(np.uint8)]
    return np.where((depths > 0)[..., None], coloured, np.array(NOTHING, np.uint8))


def depth_error_picture(
    depths: Float[np.ndarray, "h w"], truth: Float[np.ndarray, "h w"]
) -> UInt8[np.ndarray, "h w 3"]:
    """|z - truth| / truth in colours, from black at 0 to light yellow at `WORST_ERROR` and beyond; grey without truth."""
    known = truth > 0
    error = np.abs(depths - truth) / np.where(known, truth, 1)
    coloured = _error_palette()[np.rint(255 * np.clip(error / WORST_ERROR, 0, 1)).astype(np.uint8)]
    return np.where(known[..., None], coloured, np.array(NOTHING, np.uint8))


def depth_error_bar() -> UInt8[np.ndarray, "1 256 3"]:
    """The colours of `depth_error_picture` from no error at the left to `WORST_ERROR` at the right."""
    return _error_palette()[None]


def depth_ticks(limits: tuple[float, float], count: int) -> tuple[float, ...]:
    """The depths at evenly spaced places along `depth_bar`, its ends among them."""
    return tuple(float(depth) for depth in np.geomspace(*limits, count))


def depth_bar(width: int = 256, height: int = 1) -> UInt8[np.ndarray, "h w 3"]:
    """The colours of `depth_picture` from the near limit at the left to the far one at the right."""
    row = _palette()[np.rint(np.linspace(0, 255, width)).astype(np.uint8)]
    return np.repeat(row[None], height, axis=0)


def _palette() -> UInt8[np.ndarray, "256 3"]:
    """Turbo from its warm end, as bytes."""
    return _colours(cv2.COLORMAP_TURBO)[::-1]


def _error_palette() -> UInt8[np.ndarray, "256 3"]:
    """Inferno, as bytes."""
    return _colours(cv2.COLORMAP_INFERNO)


def _colours(palette: int) -> UInt8[np.ndarray, "256 3"]:
    """A palette of OpenCV's, which has the bytes of matplotlib's and is there at once."""
    return cv2.applyColorMap(np.arange(256, dtype=np.uint8)[None], palette)[0, :, ::-1]
