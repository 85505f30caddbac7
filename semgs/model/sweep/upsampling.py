"""Convex upsampling of depth: each Gaussian's disparity is a weighted mean of the 3x3 texels around it.

The weights are predicted from image, features and coarse depth (Teed and Deng, "RAFT", ECCV 2020). At the edge of an object, bilinear
upsampling puts Gaussians between the near and the far surface; predicted weights can choose one of them. Not in the paper.
"""

from __future__ import annotations

from dataclasses import dataclass

import torch
from jaxtyping import Float
from torch import Tensor, nn
from torch.nn.functional import pad, pixel_shuffle, pixel_unshuffle

from semgs.model.layers.cnn import beside
from semgs.runtime.precision import FullPrecisionConv2d, outside_autocast

NEIGHBOURS = 9
"""The texels that a weighted mean is over: 3x3, row by row; the middle one is number 4."""

GATE = 0.15
"""Texels whose disparity differs from the strongest one's by more than this share of it are on another surface."""

SMALLEST_START = 0.01
"""What a weight starts at where bilinear upsampling has none, so that it can learn."""

LOG_UNIT = 0.1
"""The layers see differences of log depth in this unit."""

WIDTH = 40
"""Channels of the layers that predict the weights."""


@dataclass(frozen=True)
class ConvexDisparities:
    """Disparities of the texels around each Gaussian, and their weights; a texel has `factor` x `factor` Gaussians, row by row.

    Attributes:
        neighbours: 1 / depth of the 3x3 texels [1 / m].
        weights: of the texels for each Gaussian; they sum to 1 over the texels.
    """

    neighbours: Float[Tensor, "n 9 1 h4 w4"]
    weights: Float[Tensor, "n 9 gaussian h4 w4"]

    def mean(self) -> Float[Tensor, "n h w"]:
        """The weighted mean. It has a gradient to every weight, so weights learn from it."""
        return self._arranged((self.weights * self.neighbours).sum(1))

    def mode(self) -> Float[Tensor, "n h w"]:
        """The weighted mean over the surface of the strongest weight: the texels within `GATE` of its disparity."""
        strongest, centre = self.weights[:, 0], self.neighbours[:, 0].expand_as(self.weights[:, 0])
        # One texel after the other takes a quarter of the time of `argmax` and `gather`.
        for weight, disparity in zip(self.weights.unbind(1)[1:], self.neighbours.unbind(1)[1:], strict=True):
            stronger = weight > strongest
            strongest, centre = weight.where(stronger, strongest), disparity.where(stronger, centre)
        same = self.weights * ((self.neighbours - centre[:, None]).abs() <= GATE * centre[:, None])
        return self._arranged((same * self.neighbours).sum(1) / same.sum(1))

    def _arranged(self, maps: Float[Tensor, "n gaussian h4 w4"]) -> Float[Tensor, "n h w"]:
        """One map at the Gaussians' scale."""
        return pixel_shuffle(maps, round(maps.shape[1] ** 0.5))[:, 0]


class ConvexUpsampling(nn.Module):
    """Predicts the weights from the image, features, the coarse disparities around each texel, their confidence and their spread.

    Before training the weights are bilinear upsampling's, apart from `SMALLEST_START`.

    Args:
        features: channels of the features.
        factor: Gaussians along each side of a texel.
    """

    def __init__(self, features: int, factor: int) -> None:
        super().__init__()
        self.factor = factor
        last = FullPrecisionConv2d(WIDTH, NEIGHBOURS * factor**2, 1)
        with torch.no_grad():
            last.weight.zero_()
            last.get_parameter("bias").copy_(bilinear_weights(factor).clamp(min=SMALLEST_START).log().flatten())
        self.layers = nn.Sequential(
            nn.Conv2d(3 * factor**2 + features + NEIGHBOURS + 1, WIDTH, 3, padding=1),
            nn.GELU(),
            nn.Conv2d(WIDTH, WIDTH, 3, padding=1),
            nn.GELU(),
            nn.Conv2d(WIDTH, WIDTH, 3, padding=2, dilation=2),
            nn.GELU(),
            last,
        )

    def forward(
        self,
        images: Float[Tensor, "n 3 h w"],
        features: Float[Tensor, "n c h4 w4"],
        disparities: Float[Tensor, "n h4 w4"],
        confidences: Float[Tensor, "n h4 w4"],
        spread: Float[Tensor, "n h4 w4"],
    ) -> ConvexDisparities:
        """The weights of each Gaussian.

        Args:
            images: at the Gaussians' scale.
            features: at 1/4 of the images.
            disparities: 1 / depth of the plane sweep [1 / m].
            confidences: of the plane sweep, 0..1.
            spread: of the plane sweep: standard deviation of log depth.
        """
        neighbours = around(disparities)
        # Only ratios: the weights do not depend on the unit of length.
        logs = neighbours.log() - disparities.log()[:, None]
        others = torch.cat((logs[:, : NEIGHBOURS // 2], logs[:, NEIGHBOURS // 2 + 1 :]), 1)
        depth = torch.cat((others / LOG_UNIT, confidences[:, None], spread[:, None] / LOG_UNIT), 1)
        seen = beside(pixel_unshuffle(images - 0.5, self.factor), features, depth.to(features.dtype))
        logits = self.layers(seen).to(disparities.dtype)
        return ConvexDisparities(neighbours[:, :, None], logits.unflatten(1, (NEIGHBOURS, -1)).softmax(1))


@outside_autocast
def around(maps: Float[Tensor, "n h w"]) -> Float[Tensor, "n 9 h w"]:
    """The 3x3 texels around each texel, row by row; beyond the border are the border's own."""
    height, width = maps.shape[-2:]
    wide = pad(maps[:, None], (1, 1, 1, 1), mode="replicate")[:, 0]
    return torch.stack([wide[:, y : y + height, x : x + width] for y in range(3) for x in range(3)], 1)


def bilinear_weights(factor: int) -> Float[Tensor, "9 gaussian"]:
    """The weights of the 3x3 texels in bilinear upsampling, for each of the `factor` x `factor` Gaussians of a texel."""
    offsets = (torch.arange(factor) + 0.5) / factor - 0.5  # from the centre of the texel, in texels
    line = (1 - (torch.arange(3)[:, None] - 1 - offsets).abs()).clamp(min=0)
    return torch.einsum("yi,xj->yxij", line, line).reshape(NEIGHBOURS, factor**2)
