"""Rendering: what splatting returns."""

from __future__ import annotations

from dataclasses import dataclass

import torch
from jaxtyping import Float, UInt8
from torch import Tensor


@dataclass(frozen=True)
class Rendering:
    """Gaussians as seen by cameras.

    Attributes:
        images: RGB over the background, not clamped above.
        semantics: class distribution of every pixel, sums to 1; None for colour-only Gaussians.
        depths: sum(w z) / sum(w) of the colour pass, z-depth, 0 where nothing was drawn [m].
        alphas: sum(w) of the colour pass, 0..1.
    """

    images: Float[Tensor, "*batch v 3 h w"]
    semantics: Float[Tensor, "*batch v class h w"] | None
    depths: Float[Tensor, "*batch v h w"]
    alphas: Float[Tensor, "*batch v h w"]


def likeliest(semantics: Float[Tensor, "*any class h w"]) -> UInt8[Tensor, "*any h w"]:
    """The class of every pixel that most speaks for, the first of several."""
    return semantics.detach().max(-3).indices.to(torch.uint8)  # a third of the time that `argmax` takes
