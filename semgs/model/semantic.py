"""The semantic branch: from images and shallow features to a class distribution and a shape for each Gaussian."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import torch
from jaxtyping import Float
from torch import Tensor, nn

from semgs.model.cnn import FeatureCNN
from semgs.model.heads import Head, PlainUpsampler, Upsampler, upsampled
from semgs.model.memory_format import beside
from semgs.model.padded import Padded
from semgs.model.refinement import ClassRefinement, Refined
from semgs.model.transformer import CameraTransformer

SHAPE = 7
"""Channels of the head before its classes: 3 sizes and a quaternion."""


Attributes = Callable[[slice], Tensor]
"""Given which of the views, what the head says of them [n channel h w]: raw sizes, quaternions and logits of the classes."""


@dataclass(frozen=True)
class ClassMaps:
    """What classes the branch sees at each Gaussian's place in the views.

    Attributes:
        distributions: over the classes; the texels at the lower and right border may reach past the view.
        evidence: what the classes of each view by itself are linear in, at 1/4 of its padded size; None after the transformer.
    """

    distributions: Float[Tensor, "*batch v class h2 w2"]
    evidence: Float[Tensor, "n k h4 w4"] | None


class SemanticBranch(nn.Module):
    """The branch as composed of its parts.

    Args:
        cnn: a shallow CNN of its own; None shares the colour branch's.
        refinement: of the shallow features.
        transformer: over all views.
        upsampler: to the Gaussians' scale.
        head: on the image and the upsampled features.
    """

    def __init__(
        self,
        cnn: FeatureCNN | None,
        refinement: ClassRefinement,
        transformer: CameraTransformer,
        upsampler: Upsampler | PlainUpsampler,
        head: Head,
    ) -> None:
        super().__init__()
        self.cnn = cnn
        self.refinement = refinement
        self.transformer = transformer
        self.upsampler = upsampler
        self.head = head

    def forward(self, refined: Refined, scene: Padded) -> Attributes:
        """The transformer sees all views; the function that is returned says what the head makes of some of them.

        Args:
            refined: what `refined` says of each view.
            scene: the views.
        """
        features: Tensor = self.transformer(refined.features, scene)
        return lambda at: self._attributes(scene.small[at], features[at], refined[at])

    def logits_of(self, refined: Refined, scene: Padded) -> Float[Tensor, "n class h w"]:
        """Class logits of each view by itself: the refinement's own, or else those of the head without the transformer."""
        if self.refinement.classifier is not None:
            return self._own_logits(self.refinement.classifier, refined)
        return self._attributes(scene.small, refined.features, refined)[:, SHAPE:]

    @property
    def evidence_channels(self) -> int:
        """Channels of the evidence that the refinement classifies by; 0 if it does not classify by itself."""
        return 0 if self.refinement.classifier is None else self.refinement.classifier.in_channels

    def refined(self, scene: Padded, cnn: FeatureCNN, shallow: Float[Tensor, "n c h4 w4"] | None = None) -> Refined:
        """What the refinement makes of each view by itself.

        Args:
            scene: the views.
            cnn: the shared CNN.
            shallow: what it made of the views; None computes that if it is needed.
        """

        def features(pictures: Tensor) -> Tensor:
            if shallow is not None and self.cnn is None and pictures is scene.pictures:
                return shallow
            own: Tensor = (self.cnn or cnn)(pictures)
            return own

        refined: Refined = self.refinement(scene.pictures, features)
        return refined

    def _attributes(
        self, small: Float[Tensor, "n 3 h w"], features: Float[Tensor, "n c h4 w4"], refined: Refined
    ) -> Float[Tensor, "n channel h w"]:
        """What the head says, with the refinement's own logits added where it has some."""
        raw: Tensor = self.head(beside(small, self.upsampler(features, refined.features)))
        if self.refinement.classifier is None:
            return raw
        own = self._own_logits(self.refinement.classifier, refined)
        return torch.cat((raw[:, :SHAPE], raw[:, SHAPE:] + own), dim=1)

    def _own_logits(self, classifier: nn.Conv2d, refined: Refined) -> Float[Tensor, "n class h w"]:
        """The refinement's logits at the Gaussians' scale."""
        return upsampled(classifier(refined.evidence), self.upsampler.factor, self.upsampler.pixel_centres)

    @property
    def shares_cnn(self) -> bool:
        """Whether it reads the features of the shared CNN."""
        return self.cnn is None and self.refinement.reads_shallow

    def layers(self, alone: bool = False) -> tuple[str, ...]:
        """Beginnings of the names of the parameters that the classes depend on; with `alone`, those of `logits_of`."""
        refinement = [f"refinement.{name}" for name, _ in self.refinement.named_children()]
        if not alone:
            return ("cnn", *refinement, "transformer", "upsampler", "head")
        if self.refinement.classifier is None:
            return ("cnn", *refinement, "upsampler", "head")
        between = {f"refinement.{name}" for name in self.refinement.feature_layers}
        return ("cnn", *(one for one in refinement if one not in between))

    def class_layers(self) -> tuple[str, str]:
        """Names of the layers that predict classes: the head's last and the refinement's, if it has one."""
        return f"head.{len(self.head) - 1}", "refinement.classifier"
