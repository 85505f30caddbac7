"""The semantic branch: from images and shallow features to a class distribution and a shape for each Gaussian."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import torch
from jaxtyping import Float
from torch import Tensor, nn
from torch.nn.functional import interpolate

from semgs.model.attention.transformer import CameraTransformer
from semgs.model.classes.mobilenet import SIDE, downsampled_size
from semgs.model.classes.mosaic import Mosaic
from semgs.model.classes.refinement import ClassRefinement, ViewFeatures
from semgs.model.layers.cnn import FeatureCNN, Head, PlainUpsampler, Upsampler, beside, upsample
from semgs.model.layers.network_input import MULTIPLE, NetworkInput
from semgs.runtime.precision import in_full
from semgs.scene.coarse_depth import SHRINK

SHAPE = 7
"""Channels of the head before its classes: 3 sizes and a quaternion."""

CLOSER = 1.5
"""A second look at a view is at its mirror image, so many times as large as the class backbone reads it; but at most as large as it reads whole."""

LARGEST = (3 * SIDE // 2 - 1) // MULTIPLE * MULTIPLE
"""The shorter side of the largest images that the class backbone reads whole: 352 px."""

SMALLEST = 1e-9
"""Mean probabilities of two looks below this count as this."""


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
        transformer: over all views; None for a head that reads features of single views.
        upsampler: to the Gaussians' scale.
        head: on the image and the upsampled features.
        mosaic: a second network for the classes of each view, which are then a mean; None for none.
    """

    def __init__(
        self,
        cnn: FeatureCNN | None,
        refinement: ClassRefinement,
        transformer: CameraTransformer | None,
        upsampler: Upsampler | PlainUpsampler,
        head: Head,
        mosaic: Mosaic | None = None,
    ) -> None:
        super().__init__()
        self.cnn = cnn
        self.refinement = refinement
        self.transformer = transformer
        self.upsampler = upsampler
        self.head = head
        self.mosaic = mosaic

    def forward(self, single: ViewFeatures, inputs: NetworkInput) -> Attributes:
        """Apply the transformer, if there is one, to all views; return a function that applies the head to some of them. After a second look the
        classes are the mean of the distributions of both looks (test-time augmentation).

        Args:
            single: from `refine`.
            inputs: the views.
        """
        if self.transformer is None:
            return lambda at: self._attributes(inputs.small[at], None, single[at])
        features: Tensor = self.transformer(single.features, inputs)
        return lambda at: self._attributes(inputs.small[at], features[at], single[at])

    @property
    def most_looks(self) -> int:
        """How often it can look at each view: twice if it does not compare views."""
        return 2 if self.transformer is None else 1

    def second_look(self, inputs: NetworkInput, cnn: FeatureCNN, alone: bool = False) -> Float[Tensor, "n class h w"]:
        """Class distributions from the views' enlarged mirror images, one view after the other, at the Gaussians' scale.

        Args:
            inputs: the views.
            cnn: the shared CNN.
            alone: as `single_view_logits`, without the head.
        """
        found, size = [], second_size(inputs.images.shape[-2:])
        for view in range(len(inputs.images)):
            mirrored = inputs.mirrored(view, size)
            single = self.refine(mirrored, cnn)
            logits = (
                self.single_view_logits(single, mirrored) if alone else self(single, mirrored)(slice(None))[:, SHAPE:]
            )
            maps = in_full(logits).softmax(1).flip(-1)
            found.append(interpolate(maps, inputs.small.shape[-2:], mode="bilinear", align_corners=False))
        return torch.cat(found)

    def single_view_logits(self, single: ViewFeatures, inputs: NetworkInput) -> Float[Tensor, "n class h w"]:
        """Class logits of single views: those of the refinement, or else those of the head without the transformer; with a second network or
        after a second look, the mean of both."""
        if self.refinement.classifier is not None:
            return self._mean(self._own_logits(self.refinement.classifier, single), single)
        unchanged = None if self.transformer is None else single.features
        return self._attributes(inputs.small, unchanged, single)[:, SHAPE:]

    @property
    def evidence_channels(self) -> int:
        """Channels of the evidence for the refinement's classifier; 0 if it has none."""
        return 0 if self.refinement.classifier is None else self.refinement.classifier.in_channels

    def refine(
        self,
        inputs: NetworkInput,
        cnn: FeatureCNN,
        shallow: Float[Tensor, "n c h4 w4"] | None = None,
        looks: int = 1,
        alone: bool = False,
    ) -> ViewFeatures:
        """The refinement's output for single views, and what a second network and a second look find.

        Args:
            inputs: the views.
            cnn: the shared CNN.
            shallow: its features of the views; None computes them if they are needed.
            looks: at each view, 1 or 2.
            alone: as for `second_look`.
        """

        def shallow_features(images: Tensor) -> Tensor:
            if shallow is not None and self.cnn is None:
                return shallow
            own: Tensor = (self.cnn or cnn)(images)
            return own

        single: ViewFeatures = self.refinement(inputs.images, shallow_features)
        second = None if self.mosaic is None else self.mosaic(inputs.images)
        again = None if looks < 2 else self.second_look(inputs, cnn, alone)
        return replace(single, second=second, again=again)

    def _attributes(
        self, small: Float[Tensor, "n 3 h w"], transformed: Float[Tensor, "n c h4 w4"] | None, single: ViewFeatures
    ) -> Float[Tensor, "n channel h w"]:
        """The output of the head, plus the refinement's own logits if it has any; with a second network, the mean of its and these logits."""
        features = (single.features,) if transformed is None else (transformed, single.features)
        raw: Tensor = self.head(beside(small, self.upsampler(*features)))
        if self.refinement.classifier is None and single.second is None and single.again is None:
            return raw
        logits = raw[:, SHAPE:]
        if self.refinement.classifier is not None:
            logits = logits + self._own_logits(self.refinement.classifier, single)
        # In another memory format, shapes would round otherwise.
        channels_last = raw.is_contiguous(memory_format=torch.channels_last)
        layout = torch.channels_last if channels_last else torch.contiguous_format
        mean = self._mean(logits, single).contiguous(memory_format=layout)
        return torch.cat((raw[:, :SHAPE], mean), dim=1)

    def _own_logits(self, classifier: nn.Conv2d, single: ViewFeatures) -> Float[Tensor, "n class h w"]:
        """The refinement's logits at the Gaussians' scale."""
        return upsample(classifier(single.evidence), self.upsampler.factor, self.upsampler.pixel_centres)

    def _mean(self, logits: Float[Tensor, "n class h w"], single: ViewFeatures) -> Float[Tensor, "n class h w"]:
        """The mean of both networks' distributions, from their logits, if there are two, and then of both looks, if there were two."""
        if self.mosaic is not None and single.second is not None:
            corners = not self.upsampler.pixel_centres
            second = interpolate(single.second, logits.shape[-2:], mode="bilinear", align_corners=corners)
            logits = self.mosaic.mixture(logits, second)
        return logits if single.again is None else mean_logits(logits, single.again)

    @property
    def shares_cnn(self) -> bool:
        """Whether it uses the features of the shared CNN."""
        return self.cnn is None and self.refinement.reads_shallow

    def layers(self, alone: bool = False) -> tuple[nn.Module, ...]:
        """Layers of the branch on which the classes depend; with `alone`, on which `single_view_logits` depends."""
        if not alone:
            return (self,)
        others = [layer for layer in (self.cnn, self.mosaic) if layer is not None]
        if self.refinement.classifier is not None:
            return (*others, *self.refinement.evidence_layers())
        return (*others, self.refinement, self.upsampler, self.head)

    def class_layers(self) -> tuple[nn.Module, ...]:
        """Layers that predict classes: the head's last, the refinement's and those of the second network, if it has them."""
        own = self.refinement.classifier
        second = () if self.mosaic is None else self.mosaic.class_layers()
        return (self.head[-1], *second) if own is None else (self.head[-1], *second, own)

    def pretrained_layers(self) -> tuple[nn.Module, ...]:
        """Layers that can start from published weights."""
        second = () if self.mosaic is None else self.mosaic.pretrained_layers()
        return (*self.refinement.pretrained_layers(), *second)


def second_size(size: Sequence[int]) -> tuple[int, int]:
    """The (height, width) for a second look at images of that size: multiples of 16 [px]."""
    read = downsampled_size(size, SHRINK)
    most = max(1.0, LARGEST / min(read))
    times = CLOSER if round(CLOSER * min(read) / MULTIPLE) * MULTIPLE <= LARGEST else most
    height, width = (MULTIPLE * round(times * side / MULTIPLE) for side in read)
    return height, width


def mean_logits(
    first: Float[Tensor, "n class h w"], second: Float[Tensor, "n class h w"]
) -> Float[Tensor, "n class h w"]:
    """Logarithms of the mean of two class distributions, the first from its logits."""
    return ((in_full(first).softmax(1) + second) / 2).clamp(min=SMALLEST).log()
