"""The slot of the class branch before its transformer: what turns shallow features, pictures or both into features for classes."""

from __future__ import annotations

from abc import ABC, abstractmethod
from dataclasses import dataclass

from jaxtyping import Float
from torch import Tensor, nn


@dataclass(frozen=True)
class Refined:
    """Features of the class branch before its transformer, of each view by itself; logits of the classes where the refinement has its own."""

    features: Float[Tensor, "n c h4 w4"]
    logits: Float[Tensor, "n class h4 w4"] | None


class ClassRefinement(nn.Module, ABC):
    """Refines the features of each view by itself for the class branch."""

    @abstractmethod
    def forward(
        self, pictures: Float[Tensor, "n 3 h w"], shallow: Float[Tensor, "n c h4 w4"], cnn: nn.Module
    ) -> Refined:
        """Features at a quarter of the pictures.

        Args:
            pictures: in 0..1.
            shallow: what the CNN makes of them.
            cnn: makes such features of pictures at another size.
        """
