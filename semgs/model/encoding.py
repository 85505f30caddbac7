"""Encoding: what the network returns."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

from jaxtyping import Float
from torch import Tensor

from semgs.geometry.gaussians import Gaussians


@dataclass(frozen=True)
class Encoding:
    """The network's answer to a set of context views.

    Attributes:
        gaussians: in the order view, row, column.
        depths: z-depth of every pixel of the context views, at their full size [m].
        confidences: the largest probability among the depth candidates, at the same size, 0..1.
    """

    gaussians: Gaussians
    depths: Float[Tensor, "*batch v h w"]
    confidences: Float[Tensor, "*batch v h w"]

    def map(self, function: Callable[[Tensor], Tensor]) -> Encoding:
        """The same encoding with `function` applied to each tensor, those of the Gaussians included."""
        return Encoding(self.gaussians.map(function), function(self.depths), function(self.confidences))
