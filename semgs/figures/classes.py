"""Class maps as pictures: labels, colours, the hatching of what was not seen, the legend."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass

import numpy as np
from jaxtyping import Bool, UInt8

from semgs.data.classes import IGNORE, ClassTable
from semgs.rendering.rendering import Rendering, likeliest

SEEN_ALPHA = 0.5
"""Where less light than this was stopped by Gaussians, a map says "unseen" instead of a class."""

HATCH = ((52, 54, 60), (120, 124, 132))
"""The two greys of the stripes over what was not seen."""

_STRIPE_PX = 5


@dataclass(frozen=True)
class LegendEntry:
    """A line of a legend.

    Attributes:
        name: of the class.
        colour: sRGB, 0..255.
        share: of the labelled pixels, 0..1.
    """

    name: str
    colour: tuple[int, int, int]
    share: float


def label_maps(rendering: Rendering) -> UInt8[np.ndarray, "v h w"]:
    """The likeliest class of every pixel, 255 where the colour pass has alpha < 0.5: nothing was seen there.

    Raises:
        ValueError: the rendering has no classes.
    """
    if rendering.semantics is None:
        raise ValueError("the rendering has no classes; expected one of Gaussians with a semantic branch")
    labels = likeliest(rendering.semantics).cpu().numpy()
    labels[rendering.alphas.detach().cpu().numpy() < SEEN_ALPHA] = IGNORE
    return labels


def class_picture(labels: UInt8[np.ndarray, "h w"], classes: ClassTable) -> UInt8[np.ndarray, "h w 3"]:
    """Labels in the colours of their classes; pixels without one (255) are hatched."""
    return _coloured(labels, classes, hatching(labels.shape))


def true_class_picture(labels: UInt8[np.ndarray, "h w"], classes: ClassTable) -> UInt8[np.ndarray, "h w 3"]:
    """Ground-truth labels in the colours of their classes; pixels without one are black, as nobody labelled them."""
    return _coloured(labels, classes, np.zeros((*labels.shape, 3), np.uint8))


def overlay(
    photo: UInt8[np.ndarray, "h w 3"], labels: UInt8[np.ndarray, "h w"], classes: ClassTable, strength: float = 0.55
) -> UInt8[np.ndarray, "h w 3"]:
    """A photo tinted by the class of each pixel, `strength` of the class colour; pixels without one stay as they are."""
    tint = _coloured(labels, classes, photo).astype(np.float32)
    return np.rint(photo + strength * (tint - photo)).astype(np.uint8)


def legend(maps: Iterable[np.ndarray], classes: ClassTable) -> tuple[LegendEntry, ...]:
    """The classes that occur in the maps, the most frequent first."""
    counts = sum(
        (np.bincount(labels.ravel(), minlength=256)[: len(classes)] for labels in maps), np.zeros(len(classes))
    )
    order = sorted(np.flatnonzero(counts), key=lambda label: -counts[label])
    return tuple(
        LegendEntry(classes.names[label], classes.colours[label], float(counts[label] / counts.sum()))
        for label in order
    )


def hatching(size: tuple[int, ...]) -> UInt8[np.ndarray, "h w 3"]:
    """Diagonal stripes of two greys, as no class looks."""
    rows, columns = np.indices(size)
    return np.array(HATCH, np.uint8)[((rows + columns) // _STRIPE_PX) % 2]


def _coloured(
    labels: UInt8[np.ndarray, "h w"], classes: ClassTable, elsewhere: UInt8[np.ndarray, "h w 3"]
) -> UInt8[np.ndarray, "h w 3"]:
    """Class colours where there is a label, another picture where there is none."""
    palette = np.zeros((256, 3), np.uint8)
    palette[: len(classes)] = classes.colours
    has_label: Bool[np.ndarray, "h w 1"] = (labels != IGNORE)[..., None]
    return np.where(has_label, palette[labels], elsewhere)
