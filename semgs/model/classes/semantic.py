"""The semantic branch: from images and shallow features to a class distribution and a shape for each Gaussian."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import torch
from jaxtyping import Float
from torch import Tensor, nn

from semgs.model.attention.transformer import CameraTransformer
from semgs.model.classes.refinement import ClassRefinement, Refined
from semgs.model.gaussians.heads import Head, PlainUpsampler, Upsampler, upsampled
from semgs.model.layers.cnn import FeatureCNN
from semgs.model.layers.memory_format import beside
from semgs.model.layers.network_input import Padded

SHAPE = 7
"""Channels of the head before its classes: 3 sizes and a quaternion."""


Attributes = Callable[[slice], Tensor]
"""From a slice of the views to the head's output [n channel h w]: raw sizes, quaternions and class logits."""


@dataclass(frozen=True)
class ClassMaps:
    """Class distributions at each Gaussian's position in the views.

    Attributes:
        distributions: over the classes; texels at the lower and right border may reach past the view.
        evidence: maps in which the class logits of single views are linear, at 1/4 of the padded size; None after the transformer.
    """

    distributions: Float[Tensor, "*batch v class h2 w2"]
    evidence: Float[Tensor, "n k h4 w4"] | None


class SemanticBranch(nn.Module):
    """The branch, composed of its parts.

    Args:
        cnn: its own shallow CNN; None shares that of the colour branch.
        refinement: features of single views.
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
        """Apply the transformer to all views; return a function that applies the head to some of them.

        Args:
            refined: from `refined`.
            scene: the views.
        """
        features: Tensor = self.transformer(refined.features, scene)
        return lambda at: self._attributes(scene.small[at], features[at], refined[at])

    def logits_of(self, refined: Refined, scene: Padded) -> Float[Tensor, "n class h w"]:
        """Class logits of single views: those of the refinement, or else those of the head without the transformer."""
        if self.refinement.classifier is not None:
            return self._own_logits(self.refinement.classifier, refined)
        return self._attributes(scene.small, refined.features, refined)[:, SHAPE:]

    @property
    def evidence_channels(self) -> int:
        """Channels of the evidence for the refinement's classifier; 0 if it has none."""
        return 0 if self.refinement.classifier is None else self.refinement.classifier.in_channels

    def refined(self, scene: Padded, cnn: FeatureCNN, shallow: Float[Tensor, "n c h4 w4"] | None = None) -> Refined:
        """The refinement's output for single views.

        Args:
            scene: the views.
            cnn: the shared CNN.
            shallow: its features of the views; None computes them if they are needed.
        """

        def features(images: Tensor) -> Tensor:
            if shallow is not None and self.cnn is None:
                return shallow
            own: Tensor = (self.cnn or cnn)(images)
            return own

        refined: Refined = self.refinement(scene.images, features)
        return refined

    def _attributes(
        self, small: Float[Tensor, "n 3 h w"], features: Float[Tensor, "n c h4 w4"], refined: Refined
    ) -> Float[Tensor, "n channel h w"]:
        """The output of the head, plus the refinement's own logits if it has any."""
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
        """Whether it uses the features of the shared CNN."""
        return self.cnn is None and self.refinement.reads_shallow

    def layers(self, alone: bool = False) -> tuple[str, ...]:
        """Beginnings of the names of the parameters on which the classes depend; with `alone`, on which `logits_of` depends."""
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
