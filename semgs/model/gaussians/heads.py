"""Heads: from features and depth to the attributes of each Gaussian, in MVSplat's form and in the paper's.

In `base` and `mvsplat`, layer shapes and names are those of MVSplat, so that its weights load.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Callable
from dataclasses import dataclass

import torch
from jaxtyping import Float
from torch import Tensor, nn

from semgs.geometry.plane_sweep import expected_depth
from semgs.model.layers.cnn import Head, Upsampler, beside, upsample
from semgs.model.layers.network_input import NetworkInput, by_chunks
from semgs.model.settings import Conventions, MVSplatHeads
from semgs.model.sweep.depth import Depth
from semgs.model.sweep.unet import UNet
from semgs.model.sweep.upsampling import ConvexDisparities, ConvexUpsampling
from semgs.runtime.precision import FullPrecisionConv2d

RENDERED_HARMONICS = 16
"""Coefficients per colour channel that are rendered: degrees 0 to 3."""


Features = Float[Tensor, "n c h4 w4"]
"""Feature maps at the network's scale."""


@dataclass(frozen=True)
class RawGaussians:
    """Predictions for each Gaussian of n views, in both forms of the heads.

    Attributes:
        depths: [m].
        opacities: 0..1.
        attributes: raw sizes, quaternions and harmonics of the colour Gaussians.
        confidences: the largest probability among the depth candidates, 0..1.
        depth_spread: standard deviation of log depth under the candidates' distribution.
        offsets: raw (x, y) shifts from the pixel's centre; None for no shifts.
    """

    depths: Float[Tensor, "n h w"]
    opacities: Float[Tensor, "n h w"]
    attributes: Float[Tensor, "n d h w"]
    confidences: Float[Tensor, "n h w"]
    depth_spread: Float[Tensor, "n h w"]
    offsets: Float[Tensor, "n 2 h w"] | None = None


class DepthRefinement(nn.Module):
    """Full-size correction of disparity, and opacity: a U-Net on image, features, disparity and its probability.

    Args:
        settings: of these heads.
    """

    def __init__(self, settings: MVSplatHeads) -> None:
        super().__init__()
        width = settings.width
        self.project = nn.Conv2d(settings.upsampled, settings.projected, 3, padding=1)
        first = nn.Conv2d(3 + settings.projected + 2, width, 3, padding=1)
        unet = UNet(width, settings.levels, settings.decoder_blocks)
        self.refine = nn.ModuleList([first, nn.GroupNorm(4, width), nn.GELU(), unet])
        self.to_disparity = nn.Sequential(
            nn.Conv2d(width, 2 * width, 3, padding=1), nn.GELU(), FullPrecisionConv2d(2 * width, 2, 3, padding=1)
        )

    def forward(
        self,
        images: Float[Tensor, "n 3 h w"],
        projected: Float[Tensor, "n p h w"],
        disparities: Float[Tensor, "n h w"],
        confidences: Float[Tensor, "n h w"],
        views: int,
    ) -> tuple[Float[Tensor, "n d h w"], Float[Tensor, "n 2 h w"]]:
        """Features of the refinement, and (correction of disparity, logit of opacity) in the dtype of the disparities.

        `projected` are the upsampled features after `project`.
        """
        x = beside(images, projected, disparities[:, None], confidences[:, None])
        conv, norm, activation, unet = self.refine
        refined = unet(activation(norm(conv(x))), views)
        return refined, self.to_disparity(refined).to(disparities.dtype)


class Decoder(nn.Module, ABC):
    """The heads: they turn features and depth into the attributes of Gaussians."""

    def depth_layers(self) -> tuple[nn.Module, ...]:
        """Layers on which depth depends."""
        return ()

    def upsampling_layers(self) -> tuple[nn.Module, ...]:
        """Layers that upsample depth."""
        return ()

    def convex_disparities(
        self, inputs: NetworkInput, shallow: Features, features: Features, depth: Depth
    ) -> ConvexDisparities | None:
        """Disparities by convex upsampling; None if the heads have none."""
        return None

    @abstractmethod
    def forward(
        self, inputs: NetworkInput, shallow: Features, features: Features, depth: Depth, views_at_a_time: int | None
    ) -> DecodeViews:
        """Compute what needs all views; return a function that decodes some of them.

        Args:
            inputs: the views.
            shallow: features of single views.
            features: of the colour transformer.
            depth: of the plane sweep.
            views_at_a_time: views that will be decoded at a time; None is all.
        """


DecodeViews = Callable[[slice], RawGaussians]
"""From a slice of the views to the attributes of their Gaussians."""


class MVSplatDecoder(Decoder):
    """MVSplat's form: the refinement corrects disparity and predicts opacity, and the colour head reads its features.

    Args:
        upsampler: of the features.
        refinement: of disparity.
        colour: the head.
        harmonics: coefficients per colour channel.
        conventions: of geometry.
        convex: upsamples disparity; the refinement's correction is then not used. None for bilinear upsampling and correction.
    """

    def __init__(
        self,
        upsampler: Upsampler,
        refinement: DepthRefinement,
        colour: Head,
        harmonics: int,
        conventions: Conventions,
        convex: ConvexUpsampling | None = None,
    ) -> None:
        super().__init__()
        self.upsampler = upsampler
        self.refinement = refinement
        self.colour = colour
        self.harmonics = harmonics
        self.factor = upsampler.factor
        self.conventions = conventions
        self.convex = convex

    def depth_layers(self) -> tuple[nn.Module, ...]:
        """Layers on which depth depends."""
        return self.upsampler, self.refinement, *self.upsampling_layers()

    def upsampling_layers(self) -> tuple[nn.Module, ...]:
        """Layers that upsample depth."""
        return () if self.convex is None else (self.convex,)

    def convex_disparities(
        self, inputs: NetworkInput, shallow: Features, features: Features, depth: Depth
    ) -> ConvexDisparities | None:
        """Disparities by convex upsampling; None without it."""
        return None if self.convex is None else self._upsampled(inputs, self.upsampler.join(features, shallow), depth)

    def _upsampled(self, inputs: NetworkInput, joined: Features, depth: Depth) -> ConvexDisparities:
        """The same, from the joined features."""
        assert self.convex is not None
        coarse = sweep_disparities(depth, self.conventions)
        upsampled: ConvexDisparities = self.convex(inputs.small, joined, coarse, depth.confidences(1), depth.spread(1))
        return upsampled

    def forward(
        self, inputs: NetworkInput, shallow: Features, features: Features, depth: Depth, views_at_a_time: int | None
    ) -> DecodeViews:
        """The decoder of all views; the refinement sees them together."""
        confidences, spread = depth.confidences(self.factor), depth.spread(self.factor)
        # The upsampled features are needed twice. If views come in chunks, they are computed twice to save memory.
        whole: Tensor | None = None
        if self.convex is None:
            disparities = coarse_disparities(depth, self.factor, self.conventions)
            whole = self.upsampler(features, shallow) if views_at_a_time is None else None
        else:
            joined = self.upsampler.join(features, shallow)
            disparities = self._upsampled(inputs, joined, depth).mode()
            whole = self.upsampler.widen(joined) if views_at_a_time is None else None
            del joined

        def wide(at: slice) -> Tensor:
            return self.upsampler(features[at], shallow[at]) if whole is None else whole[at]

        projected = by_chunks(lambda at: self.refinement.project(wide(at)), len(features), views_at_a_time)
        near, far = depth.planes.bounds[:, :, None, None].unbind(1)
        unit = near if self.conventions.relative_disparity else torch.ones_like(near)
        refined, raw = self.refinement(inputs.small, projected, disparities * unit, confidences, inputs.views)
        corrected = disparities + raw[:, 0] / unit if self.convex is None else disparities
        depths = 1 / corrected.clamp(1 / far, 1 / near)
        opacities = raw[:, 1].sigmoid()

        def decode(at: slice) -> RawGaussians:
            evidence = beside(refined[at], inputs.small[at], wide(at))
            attributes = rendered_attributes(self.colour, self.harmonics, evidence)
            return RawGaussians(
                depths[at], opacities[at], attributes[:, 2:], confidences[at], spread[at], attributes[:, :2]
            )

        return decode


class PaperDecoder(Decoder):
    """The paper's text. Upsampling is linear, so the expectation of the upsampled distribution is the upsampled expectation.

    Args:
        opacity: a CNN on the upsampled distribution.
        colour: the head.
        harmonics: coefficients per colour channel.
        factor: from the features' scale to the Gaussians'.
        conventions: of geometry.
    """

    def __init__(self, opacity: Head, colour: Head, harmonics: int, factor: int, conventions: Conventions) -> None:
        super().__init__()
        self.opacity = opacity
        self.colour = colour
        self.harmonics = harmonics
        self.factor = factor
        self.conventions = conventions

    def forward(
        self, inputs: NetworkInput, shallow: Features, features: Features, depth: Depth, views_at_a_time: int | None
    ) -> DecodeViews:
        """The decoder of all views; each view is decoded on its own."""
        sampling, corners = self.conventions.candidates, self.conventions.pixel_centres

        def decode(at: slice) -> RawGaussians:
            part = depth[at]
            distribution = upsample(part.probabilities, self.factor, corners)
            wide = upsample(features[at], self.factor, corners)
            opacity: Tensor = self.opacity(distribution)
            return RawGaussians(
                expected_depth(distribution, part.planes.depths, sampling),
                opacity[:, 0].to(distribution.dtype).sigmoid(),
                rendered_attributes(self.colour, self.harmonics, beside(inputs.small[at], wide)),
                part.confidences(self.factor),
                part.spread(self.factor),
            )

        return decode


def rendered_attributes(head: Head, harmonics: int, x: Float[Tensor, "n c h w"]) -> Float[Tensor, "n d h w"]:
    """The output of a head, whose last channels are `harmonics` coefficients per colour, without those that are never rendered."""
    if harmonics <= RENDERED_HARMONICS:
        everything: Tensor = head(x)
        return everything
    first, activation, last = head
    assert isinstance(last, nn.Conv2d)
    assert last.bias is not None
    start = last.out_channels - 3 * harmonics
    live = [*range(start), *(start + harmonics * c + k for c in range(3) for k in range(RENDERED_HARMONICS))]
    return nn.functional.conv2d(
        activation(first(x)), last.weight[live], last.bias[live], padding=last.kernel_size[0] // 2
    )


def coarse_disparities(depth: Depth, factor: int, conventions: Conventions) -> Float[Tensor, "n h w"]:
    """1 / expected depth, upsampled to maps `factor` times as large [1 / m]."""
    return upsample(sweep_disparities(depth, conventions)[:, None], factor, conventions.pixel_centres)[:, 0]


def sweep_disparities(depth: Depth, conventions: Conventions) -> Float[Tensor, "n h4 w4"]:
    """1 / expected depth of the plane sweep [1 / m]."""
    return 1 / expected_depth(depth.probabilities, depth.planes.depths, conventions.candidates)
