"""A pyramid of features for the semantic branch: down to coarse maps that see much of the image, and back up.

To recognise a thing, a network needs its surroundings and its true colours. The shallow layers see neither: they are made to match
points between views, are a few pixels wide and normalise each image. With `semgs.model.settings.Pyramid` in the settings, the pyramid
replaces the paper's two residual blocks.
"""

from __future__ import annotations

import torch
from jaxtyping import Float
from torch import Tensor, nn
from torch.nn.functional import interpolate, pixel_unshuffle

from semgs.model.cnn import SHRINK
from semgs.model.refinement import ImageRefinement, Refined, Shallow

BLOCKS = 2
"""Residual blocks per coarser map on the way down."""

SIDE = 240
"""Shorter side of the images that the class branch is trained for [px]; things look different at twice the size."""


class SemanticPyramid(ImageRefinement):
    """Residual blocks with batch norm on maps of halved sizes, summed on the way back up; the finest gives classes.

    It uses batch norm, because the instance and group norms of the other branches remove what distinguishes one image from another.

    Args:
        channels: of the features, in and out.
        widths: channels of the coarser maps.
        classes: number of classes.
    """

    def __init__(self, channels: int, widths: tuple[int, ...], classes: int) -> None:
        super().__init__()
        sizes = (channels, *widths)
        steps = list(zip(sizes, widths, strict=False))
        self.stem = normed(nn.Conv2d(channels + 3 * SHRINK**2, channels, 1, bias=False))
        self.down = nn.ModuleList(
            normed(nn.Conv2d(fine, coarse, 3, stride=2, padding=1, bias=False)) for fine, coarse in steps
        )
        self.blocks = nn.ModuleList(nn.Sequential(*(Residual(width) for _ in range(BLOCKS))) for width in widths)
        self.up = nn.ModuleList(nn.Conv2d(coarse, fine, 1) for fine, coarse in steps)
        self.merged = nn.ModuleList(Residual(width) for width in sizes[:-1])
        self.classifier = nn.Conv2d(channels, classes, 1)

    def forward(self, images: Float[Tensor, "n 3 h w"], shallow: Shallow) -> Refined:
        """Features at 1/4 of the images. Large images are downsampled first, and their features upsampled."""
        known = near_side(images, SHRINK)
        refined = self.refined(shallow(known), known)
        if known is not images:
            size = (images.shape[-2] // SHRINK, images.shape[-1] // SHRINK)
            refined = interpolate(refined, size=size, mode="bilinear")
        return Refined(refined, refined)

    def refined(
        self, features: Float[Tensor, "n c h4 w4"], images: Float[Tensor, "n 3 h w"]
    ) -> Float[Tensor, "n c h4 w4"]:
        """Features of the same size, from shallow features and their images (0..1)."""
        x = torch.cat((features, pixel_unshuffle(2 * images - 1, SHRINK)), dim=1)
        maps: list[Tensor] = [self.stem(x.contiguous(memory_format=torch.channels_last))]
        for down, blocks in zip(self.down, self.blocks, strict=True):
            maps.append(blocks(down(maps[-1])))
        x = maps.pop()
        for up, merged in zip(reversed(self.up), reversed(self.merged), strict=True):
            fine = maps.pop()
            wide = interpolate(up(x), size=fine.shape[-2:], mode="bilinear", align_corners=False)
            x = merged(fine + wide)
        return x


def near_side(images: Float[Tensor, "n 3 h w"], shrink: int) -> Float[Tensor, "n 3 h_small w_small"]:
    """Images downsampled by the integer that brings their shorter side closest to `SIDE`, to multiples of `shrink`; small ones are unchanged."""
    times = round(min(images.shape[-2:]) / SIDE)
    if times <= 1:
        return images
    height, width = (shrink * -(-side // (shrink * times)) for side in images.shape[-2:])
    return interpolate(images, size=(height, width), mode="area")


class Residual(nn.Module):
    """relu(x + norm(conv(relu(norm(conv(x)))))); the second norm starts at zero."""

    def __init__(self, channels: int) -> None:
        super().__init__()
        self.first = normed(nn.Conv2d(channels, channels, 3, padding=1, bias=False))
        self.second = nn.Conv2d(channels, channels, 3, padding=1, bias=False)
        self.norm = nn.BatchNorm2d(channels)
        nn.init.zeros_(self.norm.weight)

    def forward(self, x: Float[Tensor, "n c h w"]) -> Float[Tensor, "n c h w"]:
        """Features of the same size."""
        return torch.relu(x + self.norm(self.second(self.first(x))))


def normed(conv: nn.Conv2d) -> nn.Sequential:
    """relu(norm(conv(x)))."""
    return nn.Sequential(conv, nn.BatchNorm2d(conv.out_channels), nn.ReLU())
