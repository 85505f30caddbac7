"""Input and output of one pass of splatting: one scene's Gaussians with one appearance, and one view of them."""

from __future__ import annotations

from dataclasses import dataclass

from jaxtyping import Float
from torch import Tensor


@dataclass(frozen=True)
class Splats:
    """One scene's Gaussians with the features that one pass blends.

    Attributes:
        means: positions in the world [m].
        quaternions: axes in the world (w, x, y, z).
        scales: standard deviations along the axes [m].
        opacities: 0..1.
        features: to blend: colour and depth, or a class distribution.
    """

    means: Float[Tensor, "g 3"]
    quaternions: Float[Tensor, "g 4"]
    scales: Float[Tensor, "g 3"]
    opacities: Float[Tensor, " g"]
    features: Float[Tensor, "g c"]


@dataclass(frozen=True)
class Layer:
    """One view of splats, without a background.

    Attributes:
        picture: sum_i w_i f_i.
        transmittance: 1 - sum_i w_i, the light that passes all Gaussians; a back-end may use a finer dtype.
    """

    picture: Float[Tensor, "c h w"]
    transmittance: Float[Tensor, "h w"]
