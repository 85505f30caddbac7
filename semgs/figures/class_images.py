"""Class maps as images, and their legend."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass

import numpy as np
from jaxtyping import UInt8

from semgs.data.tables.classes import ClassTable
from semgs.files.images.colours import class_colours, hatching
from semgs.rendering.rendering import UNKNOWN

UNKNOWN_GREY = (212, 212, 214)
"""The colour of seen pixels whose class is not sure enough."""


@dataclass(frozen=True)
class LegendEntry:
    """An entry of a legend.

    Attributes:
        name: of the class.
        colour: sRGB, 0..255.
        share: of the labelled pixels, 0..1.
    """

    name: str
    colour: tuple[int, int, int]
    share: float


def class_picture(labels: UInt8[np.ndarray, "h w"], classes: ClassTable) -> UInt8[np.ndarray, "h w 3"]:
    """Labels in the colours of their classes; unseen pixels (255) are hatched, and unknown ones (254) light grey."""
    elsewhere = hatching(labels.shape)
    elsewhere[labels == UNKNOWN] = UNKNOWN_GREY
    return class_colours(labels, classes.colours, elsewhere)


def true_class_picture(labels: UInt8[np.ndarray, "h w"], classes: ClassTable) -> UInt8[np.ndarray, "h w 3"]:
    """Ground-truth labels in the colours of their classes; unlabelled pixels are black."""
    return class_colours(labels, classes.colours, np.zeros((*labels.shape, 3), np.uint8))


def overlay(
    photo: UInt8[np.ndarray, "h w 3"], labels: UInt8[np.ndarray, "h w"], classes: ClassTable, strength: float = 0.55
) -> UInt8[np.ndarray, "h w 3"]:
    """A photo tinted with the class colour of each pixel, by `strength`; pixels without a class are unchanged."""
    tint = class_colours(labels, classes.colours, photo).astype(np.float32)
    return np.rint(photo + strength * (tint - photo)).astype(np.uint8)


def legend(maps: Iterable[np.ndarray], classes: ClassTable) -> tuple[LegendEntry, ...]:
    """The classes that occur in the maps, the most frequent first."""
    counts = sum(
        (np.bincount(labels.ravel(), minlength=256)[: len(classes)] for labels in maps), np.zeros(len(classes))
    )
    return legend_of(counts, np.flatnonzero(counts), classes)


def legend_of(pixels: np.ndarray, labels: np.ndarray, classes: ClassTable) -> tuple[LegendEntry, ...]:
    """Entries of some labels, the most frequent first.

    Args:
        pixels: number of pixels of each class.
        labels: to show.
        classes: the class table.
    """
    order = sorted(labels.tolist(), key=lambda label: -pixels[label])
    return tuple(
        LegendEntry(classes.names[label], classes.colours[label], float(pixels[label] / pixels.sum()))
        for label in order
    )
