"""Rendering: what splatting returns."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import torch
from jaxtyping import Float, UInt8
from torch import Tensor

from semgs.files.colours import NamedColours
from semgs.files.notebook import Strip, class_row, depth_row, html, photo_row
from semgs.geometry.summaries import array_of, summary

SEEN_ALPHA = 0.5
"""Where less light than this was stopped by Gaussians, a map says "unseen" instead of a class."""

UNSEEN = 255
"""What it says there."""


@dataclass(frozen=True)
class Rendering:
    """Gaussians as seen by cameras.

    Attributes:
        images: RGB over the background, 0..1; brighter where `render` was told not to clamp.
        semantics: class distribution of every pixel, sums to 1; None for colour-only Gaussians.
        depths: sum(w z) / sum(w) of the colour pass, z-depth, 0 where nothing was drawn [m].
        alphas: sum(w) of the colour pass, 0..1.
        classes: names and colours of the classes, to show them by; None where nobody said.
    """

    images: Float[Tensor, "*batch v 3 h w"]
    semantics: Float[Tensor, "*batch v class h w"] | None
    depths: Float[Tensor, "*batch v h w"]
    alphas: Float[Tensor, "*batch v h w"]
    classes: NamedColours | None = None

    def __repr__(self) -> str:
        return summary(
            "Rendering", images=self.images, semantics=self.semantics, depths=self.depths, alphas=self.alphas
        )

    def _repr_html_(self) -> str:
        """Images, class maps and depth, as a notebook shows them."""
        rows: list[Strip] = [photo_row("images", array_of(self.images))]
        if self.semantics is not None:
            rows.append(class_row("classes", label_maps(self), self.classes))
        return html(repr(self), [*rows, depth_row("depths", array_of(self.depths))])


def likeliest(semantics: Float[Tensor, "*any class h w"]) -> UInt8[Tensor, "*any h w"]:
    """The class of every pixel that most speaks for, the first of several."""
    return semantics.detach().max(-3).indices.to(torch.uint8)  # a third of the time that `argmax` takes


def label_maps(rendering: Rendering) -> UInt8[np.ndarray, "*batch v h w"]:
    """The likeliest class of every pixel, 255 where the colour pass has alpha < 0.5: nothing was seen there.

    Raises:
        ValueError: the rendering has no classes.
    """
    if rendering.semantics is None:
        raise ValueError("the rendering has no classes; expected one of Gaussians with a semantic branch")
    labels = likeliest(rendering.semantics).cpu().numpy()
    labels[rendering.alphas.detach().cpu().numpy() < SEEN_ALPHA] = UNSEEN
    return labels
