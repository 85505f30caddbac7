"""Colour maps for classes and depth."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from typing import Protocol, runtime_checkable

import cv2
import numpy as np
from jaxtyping import Float, UInt8

Colour = tuple[int, int, int]
"""sRGB, 0..255."""

HATCH = ((52, 54, 60), (120, 124, 132))
"""The two greys of the stripes over unseen pixels."""

NOTHING = (40, 42, 46)
"""The grey of pixels without depth."""

_STRIPE_PX = 5

_BYTES = np.arange(256) / 255
LINEAR = np.where(_BYTES <= 0.04045, _BYTES / 12.92, ((_BYTES + 0.055) / 1.055) ** 2.4)
"""Linear light of an sRGB byte, 0..1."""


@runtime_checkable
class NamedColours(Protocol):
    """A name and a colour for each class, in label order. `ClassTable` is one."""

    @property
    def names(self) -> tuple[str, ...]:
        """The classes."""
        ...

    @property
    def colours(self) -> tuple[Colour, ...]:
        """Their colours."""
        ...


def class_colours(
    labels: UInt8[np.ndarray, "h w"], colours: Sequence[Colour], elsewhere: UInt8[np.ndarray, "h w 3"]
) -> UInt8[np.ndarray, "h w 3"]:
    """The colour of each pixel's class; pixels without a class (label 255) come from the image `elsewhere`."""
    palette = np.zeros((256, 3), np.uint8)
    palette[: len(colours)] = colours
    return np.where((labels < len(colours))[..., None], palette[labels], elsewhere)


def hatching(size: tuple[int, ...]) -> UInt8[np.ndarray, "h w 3"]:
    """Diagonal stripes in two greys, unlike any class."""
    rows, columns = np.indices(size)
    return np.array(HATCH, np.uint8)[((rows + columns) // _STRIPE_PX) % 2]


def depth_limits(maps: Iterable[np.ndarray]) -> tuple[float, float]:
    """The depth range for colouring several maps: 1st to 99th percentile of the known depths (> 0).

    (1, 10) if no depth is known.
    """
    known = np.concatenate([np.zeros(0), *(depths[depths > 0].ravel() for depths in maps)])
    if not known.size:
        return 1.0, 10.0
    low, high = (float(limit) for limit in np.percentile(known, (1, 99)))
    return (low, high) if high > low else (low * 0.95, low * 1.05)


def depth_picture(depths: Float[np.ndarray, "h w"], limits: tuple[float, float]) -> UInt8[np.ndarray, "h w 3"]:
    """Depth in colours (turbo, near is red), on a log scale between the limits; unknown pixels are grey.

    On a linear scale, the far end of a room would leave few colours for the near things.
    """
    low, high = limits
    steps = np.log(np.clip(depths, low, high) / low) / np.log(high / low)
    coloured = depth_palette()[np.rint(255 * steps).astype(np.uint8)]
    return np.where((depths > 0)[..., None], coloured, np.array(NOTHING, np.uint8))


def heat_picture(values: Float[np.ndarray, "h w"], limits: tuple[float, float]) -> UInt8[np.ndarray, "h w 3"]:
    """Numbers in colours (inferno, high is bright) between two limits; pixels without a number (NaN) are hatched."""
    low, high = limits
    steps = np.clip((np.nan_to_num(values) - low) / max(high - low, 1e-12), 0, 1)
    coloured = opencv_palette(cv2.COLORMAP_INFERNO)[np.rint(255 * steps).astype(np.uint8)]
    return np.where(np.isnan(values)[..., None], hatching(values.shape), coloured)


def depth_palette() -> UInt8[np.ndarray, "256 3"]:
    """The colours of depth from near to far: turbo reversed."""
    return opencv_palette(cv2.COLORMAP_TURBO)[::-1]


def opencv_palette(palette: int) -> UInt8[np.ndarray, "256 3"]:
    """One of OpenCV's palettes: the same bytes as matplotlib's, but quick to import."""
    return cv2.applyColorMap(np.arange(256, dtype=np.uint8)[None], palette)[0, :, ::-1]
