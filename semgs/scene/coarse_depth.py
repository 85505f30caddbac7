"""Depth at a quarter of the image's size, as a plane sweep gives it: what losses and metrics of depth read."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

from jaxtyping import Float
from torch import Tensor

SHRINK = 4
"""Pixels along each side of a texel."""


@dataclass(frozen=True)
class FinerDepth:
    """A plane sweep's depth after convex upsampling, repeated to the views' full size.

    Attributes:
        mean: the weighted mean of the texels around, which training compares [m].
        mode: the same over the surface of the strongest weight alone, where Gaussians are placed [m].
    """

    mean: Float[Tensor, "*batch v h w"]
    mode: Float[Tensor, "*batch v h w"]


@dataclass(frozen=True)
class CoarseDepth:
    """Depth by the plane sweep alone, before any refinement.

    Attributes:
        depths: expectation over the candidates, upsampled to the views' full size [m].
        probabilities: of the candidates at 1/4 of that size; only texels whose centre lies in the view.
        candidates: their depths, far to near [m].
        spacing: whether the candidates are evenly spaced in inverse depth or in depth ("linear").
        finer: the depth after convex upsampling; None if the network has none.
    """

    depths: Float[Tensor, "*batch v h w"]
    probabilities: Float[Tensor, "*batch v l h4 w4"]
    candidates: Float[Tensor, "*batch v l"]
    spacing: Literal["inverse", "linear"]
    finer: FinerDepth | None = None
