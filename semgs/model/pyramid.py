"""A pyramid of features for the semantic branch: down to coarse maps that see much of the picture, and back up.

What a thing is shows in its surroundings and in its colours as they are. The shallow layers see neither: they were made to match points
between views, a few pixels wide and normalised in each picture. This takes the place of the paper's two residual blocks where a
network asks for it (`semantic_pyramid`).
"""

from __future__ import annotations

import torch
from jaxtyping import Float
from torch import Tensor, nn
from torch.nn.functional import interpolate, pixel_unshuffle

from semgs.model.unet import ResBlock


class SemanticPyramid(nn.Module):
    """Residual blocks with group norm on maps each half the size of the one before, summed on the way back.

    Args:
        channels: of the features, in and out.
        widths: of the coarser maps, each a multiple of 8.
        shrink: the features are at 1/shrink of the picture.
    """

    def __init__(self, channels: int, widths: tuple[int, ...], shrink: int) -> None:
        super().__init__()
        self.shrink = shrink
        sizes = (channels, *widths)
        self.stem = nn.Conv2d(channels + 3 * shrink**2, channels, 1)
        self.down = nn.ModuleList(
            nn.Conv2d(fine, coarse, 3, stride=2, padding=1) for fine, coarse in zip(sizes, widths, strict=False)
        )
        self.blocks = nn.ModuleList(ResBlock(width, width) for width in widths)
        self.up = nn.ModuleList(nn.Conv2d(coarse, fine, 1) for fine, coarse in zip(sizes, widths, strict=False))
        self.merged = nn.ModuleList(ResBlock(width, width) for width in sizes[:-1])

    def forward(
        self, features: Float[Tensor, "n c h4 w4"], pictures: Float[Tensor, "n 3 h w"]
    ) -> Float[Tensor, "n c h4 w4"]:
        """Features of the same size, from them and from the pictures that they are of (0..1)."""
        x = self.stem(torch.cat((features, pixel_unshuffle(2 * pictures - 1, self.shrink)), dim=1))
        maps = [x]
        for down, block in zip(self.down, self.blocks, strict=True):
            maps.append(block(down(maps[-1]), 1))
        x = maps.pop()
        for up, merged in zip(reversed(self.up), reversed(self.merged), strict=True):
            fine = maps.pop()
            wide = interpolate(up(x), size=fine.shape[-2:], mode="bilinear", align_corners=False)
            x = merged(fine + wide, 1)
        return x
