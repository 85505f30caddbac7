"""The end of a branch: its features at the Gaussians' scale, and the head that predicts from them."""

from __future__ import annotations

from jaxtyping import Float
from torch import Tensor, nn

from semgs.model.layers.memory_format import beside
from semgs.runtime.precision import FullPrecisionConv2d


class Upsampler(nn.Module):
    """gelu(upsample(conv(maps))): features from the network's scale to the Gaussians'."""

    def __init__(self, inputs: int, outputs: int, factor: int, pixel_centres: bool = True) -> None:
        super().__init__()
        self.conv = nn.Conv2d(inputs, outputs, 3, padding=1)
        self.factor = factor
        self.pixel_centres = pixel_centres

    def forward(self, *maps: Float[Tensor, "n _ h w"]) -> Float[Tensor, "n d h2 w2"]:
        """Features `factor` times as large, from features after the transformer, features of single views, or both in this order."""
        return self.widen(self.join(*maps))

    def join(self, *maps: Float[Tensor, "n _ h w"]) -> Float[Tensor, "n d h w"]:
        """Features as one map of the same size."""
        joined: Tensor = self.conv(beside(*maps))
        return joined

    def widen(self, joined: Float[Tensor, "n d h w"]) -> Float[Tensor, "n d h2 w2"]:
        """A map of `join` at the Gaussians' scale."""
        return nn.functional.gelu(upsample(joined, self.factor, self.pixel_centres))


class PlainUpsampler(nn.Module):
    """The paper's text: upsample the features of the transformer."""

    def __init__(self, factor: int, pixel_centres: bool = True) -> None:
        super().__init__()
        self.factor = factor
        self.pixel_centres = pixel_centres

    def forward(self, first: Float[Tensor, "n c h w"], *others: Tensor) -> Float[Tensor, "n c h2 w2"]:
        """Features `factor` times as large; those of single views, after them, are not used."""
        return upsample(first, self.factor, self.pixel_centres)


class Head(nn.Sequential):
    """The two-layer CNN that predicts one branch's attributes.

    Args:
        inputs, hidden, outputs: channels.
        last_kernel: of the second layer.
        full: compute the second layer in full precision, even within autocast.
    """

    def __init__(self, inputs: int, hidden: int, outputs: int, last_kernel: int = 3, full: bool = False) -> None:
        last = FullPrecisionConv2d if full else nn.Conv2d
        super().__init__(
            nn.Conv2d(inputs, hidden, 3, padding=1),
            nn.GELU(),
            last(hidden, outputs, last_kernel, padding=last_kernel // 2),
        )


def upsample(x: Float[Tensor, "n c h w"], factor: int, pixel_centres: bool) -> Float[Tensor, "n c h2 w2"]:
    """Bilinear upsampling that preserves image corners, or the centres of the corner texels."""
    return nn.functional.interpolate(x, scale_factor=factor, mode="bilinear", align_corners=not pixel_centres)
