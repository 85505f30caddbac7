"""Rendering: the result of splatting."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import torch
from jaxtyping import Bool, Float, Float32, Int64, UInt8
from torch import Tensor

from semgs.files.images.colours import NamedColours
from semgs.files.images.notebook import Strip, class_row, depth_row, html, photo_row
from semgs.geometry.summaries import array_of, describe
from semgs.rendering.temperatures import highest_probability

SEEN_ALPHA = 0.5
"""If alpha is less than this, class maps say "unseen"."""

UNSEEN, UNKNOWN = 255, 254
"""The values for pixels that no input view saw or whose class none of them says, and for pixels whose class is not sure enough."""

EVEN = 1 + 1e-4
"""A likeliest class that is no more than this much likelier than all classes on average is no class."""

WITHOUT_CLASSES = "the rendering has no classes; expected Gaussians with a semantic branch"


@dataclass(frozen=True)
class Rendering:
    """Gaussians as seen by cameras.

    Attributes:
        images: RGB over the background, 0..1; without clamping they may be brighter.
        semantics: class distribution of every pixel, sums to 1; None for colour-only Gaussians.
        depths: z-depth: sum(w z) / sum(w) of the colour pass, 0 where nothing was rendered [m].
        alphas: sum(w) of the colour pass, 0..1.
        classes: names and colours of the classes, for display; None if unknown.
        temperature: calibrates `semantics`, as `confidence_maps` does; None if unknown.
    """

    images: Float[Tensor, "*batch v 3 h w"]
    semantics: Float[Tensor, "*batch v class h w"] | None
    depths: Float[Tensor, "*batch v h w"]
    alphas: Float[Tensor, "*batch v h w"]
    classes: NamedColours | None = None
    temperature: float | None = None

    def __repr__(self) -> str:
        return describe(
            "Rendering", images=self.images, semantics=self.semantics, depths=self.depths, alphas=self.alphas
        )

    def _repr_html_(self) -> str:
        """Images, class maps and depth, for notebooks."""
        rows: list[Strip] = [photo_row("images", array_of(self.images))]
        if self.semantics is not None:
            rows.append(class_row("classes", label_maps(self), self.classes))
        return html(repr(self), [*rows, depth_row("depths", array_of(self.depths))])


def without_class(highest: Float[Tensor, "*any"], classes: int) -> Bool[Tensor, "*any"]:
    """Where all classes are equally likely, as in Gaussians that no photo shows; nowhere if there is only one class.

    Args:
        highest: the probability of the likeliest class.
        classes: how many there are.
    """
    return (highest * classes <= EVEN) & (classes > 1)


def class_numbers(distributions: Float[Tensor, "*any class"]) -> Int64[Tensor, "*any"]:
    """The likeliest class of each distribution; `UNSEEN` where all are equally likely."""
    highest, labels = distributions.detach().max(-1)
    return torch.where(without_class(highest, distributions.shape[-1]), UNSEEN, labels)


def likeliest(semantics: Float[Tensor, "*any class h w"]) -> UInt8[Tensor, "*any h w"]:
    """The most likely class of every pixel; the first of several."""
    return semantics.detach().max(-3).indices.to(torch.uint8)  # three times as fast as `argmax`


def confidence_maps(rendering: Rendering) -> Float32[np.ndarray, "*batch v h w"]:
    """The probability of every pixel's most likely class, calibrated by the rendering's temperature if it has one; 0 for unseen pixels.

    Raises:
        ValueError: the rendering has no classes.
    """
    if rendering.semantics is None:
        raise ValueError(WITHOUT_CLASSES)
    views = rendering.semantics.detach().movedim(-3, -1)
    confidence = [highest_probability(view, rendering.temperature).float() for view in views.flatten(0, -4)]
    together = torch.stack(confidence).reshape(views.shape[:-1]).cpu().numpy()
    return np.where(_unseen(rendering), np.float32(0), together)


def check_may_be_unknown(classes: int) -> None:
    """Check that 254 is free to say "unknown".

    Raises:
        ValueError: it is a class.
    """
    if classes > UNKNOWN:
        raise ValueError(f"the table has {classes} classes; expected at most {UNKNOWN} if pixels may be unknown")


def label_maps(rendering: Rendering, min_confidence: float = 0.0) -> UInt8[np.ndarray, "*batch v h w"]:
    """The most likely class of every pixel; 255 for unseen pixels, where the colour pass has alpha < 0.5 or all classes are equally likely.

    Args:
        rendering: with classes.
        min_confidence: seen pixels with less confidence, as in `confidence_maps`, are unknown: 254.

    Raises:
        ValueError: the rendering has no classes, or so many that 254 is one of them and some may be unknown.
    """
    if rendering.semantics is None:
        raise ValueError(WITHOUT_CLASSES)
    labels = likeliest(rendering.semantics).cpu().numpy()
    if min_confidence > 0:
        check_may_be_unknown(rendering.semantics.shape[-3])
        labels[confidence_maps(rendering) < min_confidence] = UNKNOWN
    labels[_unseen(rendering)] = UNSEEN
    return labels


def _unseen(rendering: Rendering) -> Bool[np.ndarray, "*batch v h w"]:
    """The pixels that no input view saw, or whose class none of them says."""
    unseen = rendering.alphas.detach() < SEEN_ALPHA
    if rendering.semantics is not None:
        unseen |= without_class(rendering.semantics.detach().amax(-3), rendering.semantics.shape[-3])
    return unseen.cpu().numpy()
