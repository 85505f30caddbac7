"""The slot of the class branch's refinement: what makes features of each view by itself, before the transformer."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Callable
from dataclasses import dataclass
from typing import ClassVar

import torch
from jaxtyping import Float
from torch import Tensor, nn

from semgs.model.cnn import ResidualBlock
from semgs.model.memory_format import lay_out

Shallow = Callable[[Tensor], Tensor]
"""Gives the shallow CNN's features [n c h/4 w/4] of images [n 3 h w]."""

Cues = tuple[Tensor, ...]
"""Coarse maps of what each of n views shows by itself, [n c h8 w8] and [n c h16 w16], or none; they carry no gradient."""


@dataclass(frozen=True)
class Refined:
    """What a refinement makes of each view by itself.

    Attributes:
        features: for the transformer.
        evidence: for the refinement's own classifier, where it has one.
        seen: maps that `ClassRefinement.cues` makes depth's cues of, if it makes some.
    """

    features: Float[Tensor, "n c h4 w4"]
    evidence: Float[Tensor, "n k h4 w4"]
    seen: tuple[Tensor, ...] = ()

    def __getitem__(self, at: slice) -> Refined:
        """The same of some of the views, without `seen`."""
        return Refined(self.features[at], self.evidence[at])


class ClassRefinement(nn.Module, ABC):
    """What fits the slot.

    Attributes:
        reads_shallow: whether it reads the shallow features, so that these learn from classes where they are shared.
        feature_layers: names of its layers that only the transformer needs.
        cue_layers: names of the layers that `cues` needs.

    Args:
        classifier: from `Refined.evidence` to logits of the classes, which the head then corrects; None leaves the classes to the head.
    """

    reads_shallow: ClassVar[bool] = True
    feature_layers: ClassVar[tuple[str, ...]] = ()
    cue_layers: ClassVar[tuple[str, ...]] = ()

    def __init__(self, classifier: nn.Conv2d | None = None) -> None:
        super().__init__()
        self.classifier = classifier

    @abstractmethod
    def forward(self, pictures: Float[Tensor, "n 3 h w"], shallow: Shallow) -> Refined:
        """Features at 1/4 of the images (0..1).

        Args:
            pictures: with sides that are multiples of 16.
            shallow: gives the shallow features of images, these or smaller ones.
        """

    def cues(self, pictures: Float[Tensor, "n 3 h w"], seen: tuple[Tensor, ...] = ()) -> Cues:
        """What depth sees of each view by itself; nothing of this refinement.

        Args:
            pictures: as for `forward`.
            seen: what `forward` kept of them; without it, only as much is computed as is needed.
        """
        return ()


class PictureRefinement(ClassRefinement):
    """What reads the images themselves, with convolutions that are channels last in training too, where that halves the time of a step."""

    def train(self, mode: bool = True) -> PictureRefinement:
        """As of every module, and the layout stays."""
        super().train(mode)
        lay_out(self, torch.channels_last)
        return self


class ResidualRefinement(ClassRefinement):
    """The paper's: two residual blocks on the shallow features."""

    def __init__(self, channels: int) -> None:
        super().__init__()
        self.residual = nn.Sequential(ResidualBlock(channels, channels), ResidualBlock(channels, channels))

    def forward(self, pictures: Float[Tensor, "n 3 h w"], shallow: Shallow) -> Refined:
        """Features of each view; no classes."""
        features: Tensor = self.residual(shallow(pictures))
        return Refined(features, features)
