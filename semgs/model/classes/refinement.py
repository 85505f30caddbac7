"""The refinement of the class branch: features of single views, before the transformer."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import ClassVar

import torch
from jaxtyping import Float
from torch import Tensor, nn

from semgs.model.layers.cnn import ResidualBlock

Shallow = Callable[[Tensor], Tensor]
"""From images [n 3 h w] to the shallow CNN's features [n c h/4 w/4]."""

Cues = tuple[Tensor, ...]
"""Coarse maps of n single views for depth, [n c h8 w8] and [n c h16 w16], or none; they carry no gradient."""


@dataclass(frozen=True)
class ViewFeatures:
    """The output of a refinement, for single views.

    Attributes:
        features: for the transformer.
        evidence: for the refinement's own classifier, if it has one.
        cue_maps: maps from which `ClassRefinement.cues` makes depth's cues, if it makes any.
        second: class logits of a second network, at its own resolution; None if there is none.
        again: class distributions of a second look, at the Gaussians' scale; None if there was none.
    """

    features: Float[Tensor, "n c h4 w4"]
    evidence: Float[Tensor, "n k h4 w4"]
    cue_maps: tuple[Tensor, ...] = ()
    second: Float[Tensor, "n class h2 w2"] | None = None
    again: Float[Tensor, "n class h3 w3"] | None = None

    def __getitem__(self, at: slice) -> ViewFeatures:
        """The same of some of the views."""
        return ViewFeatures(
            self.features[at],
            self.evidence[at],
            tuple(cue_map[at] for cue_map in self.cue_maps),
            None if self.second is None else self.second[at],
            None if self.again is None else self.again[at],
        )

    @staticmethod
    def joined(parts: Sequence[ViewFeatures]) -> ViewFeatures:
        """Those of several views, one after the other."""

        def join(field: str) -> Tensor | None:
            found = [getattr(part, field) for part in parts]
            return None if found[0] is None else torch.cat(found)

        maps = zip(*(part.cue_maps for part in parts), strict=True)
        return ViewFeatures(
            torch.cat([part.features for part in parts]),
            torch.cat([part.evidence for part in parts]),
            tuple(torch.cat(cue_maps) for cue_maps in maps),
            join("second"),
            join("again"),
        )


class ClassRefinement(nn.Module, ABC):
    """Turns images and shallow features into features for the transformer.

    Attributes:
        reads_shallow: whether it uses the shallow features, so that shared layers learn from classes.

    Args:
        classifier: from `ViewFeatures.evidence` to class logits, which the head then corrects; None leaves the classes to the head.
    """

    reads_shallow: ClassVar[bool] = True

    def __init__(self, classifier: nn.Conv2d | None = None) -> None:
        super().__init__()
        self.classifier = classifier

    @abstractmethod
    def forward(self, images: Float[Tensor, "n 3 h w"], shallow: Shallow) -> ViewFeatures:
        """Features at 1/4 of the images (0..1).

        Args:
            images: with sides that are multiples of 16.
            shallow: computes their shallow features, if they are used.
        """

    def cues(self, images: Float[Tensor, "n 3 h w"], cue_maps: tuple[Tensor, ...] = ()) -> Cues:
        """Coarse maps of each view for depth; this refinement has none.

        Args:
            images: as for `forward`.
            cue_maps: `ViewFeatures.cue_maps` from `forward`; without them, only the necessary layers are computed.
        """
        return ()

    def evidence_layers(self) -> tuple[nn.Module, ...]:
        """Layers on which the classifier's logits depend, the classifier included."""
        return ()

    def cue_layers(self) -> tuple[nn.Module, ...]:
        """Layers on which `cues` depends."""
        return ()

    def pretrained_layers(self) -> tuple[nn.Module, ...]:
        """Layers that can start from published weights."""
        return ()


class ResidualRefinement(ClassRefinement):
    """The paper's refinement: two residual blocks on the shallow features."""

    def __init__(self, channels: int) -> None:
        super().__init__()
        self.residual = nn.Sequential(ResidualBlock(channels, channels), ResidualBlock(channels, channels))

    def forward(self, images: Float[Tensor, "n 3 h w"], shallow: Shallow) -> ViewFeatures:
        """Features of each view; no classes."""
        features: Tensor = self.residual(shallow(images))
        return ViewFeatures(features, features)
