"""The convolutions that parts of the network share: the shallow CNN with its residual blocks, the end of a branch, and how their maps lie in memory.

Layer shapes and names of the CNN are those of MVSplat's backbone (UniMatch's encoder), so that its weights load.
"""

from __future__ import annotations

import torch
from jaxtyping import Float
from torch import Tensor, nn

from semgs.runtime.precision import FullPrecisionConv2d

IMAGE_MEAN = (0.485, 0.456, 0.406)
IMAGE_STD = (0.229, 0.224, 0.225)


class ResidualBlock(nn.Module):
    """Two 3x3 convolutions with instance norm, added to their input: relu(x + relu(norm(conv(relu(norm(conv(x))))))).

    Args:
        inputs: channels in.
        outputs: channels out.
        stride: of the first convolution; if it is not 1 or the width changes, the input passes a 1x1 convolution.
    """

    def __init__(self, inputs: int, outputs: int, stride: int = 1) -> None:
        super().__init__()
        self.conv1 = nn.Conv2d(inputs, outputs, 3, stride=stride, padding=1, bias=False)
        self.conv2 = nn.Conv2d(outputs, outputs, 3, padding=1, bias=False)
        self.norm1 = instance_norm(outputs)
        self.norm2 = instance_norm(outputs)
        self.downsample: nn.Module = nn.Identity()
        if stride != 1 or inputs != outputs:
            self.downsample = nn.Sequential(nn.Conv2d(inputs, outputs, 1, stride=stride), instance_norm(outputs))

    def forward(self, x: Float[Tensor, "n inputs h w"]) -> Float[Tensor, "n outputs h2 w2"]:
        """Features of the same size, or of half of it with stride 2."""
        y = torch.relu(self.norm1(self.conv1(x)))
        y = torch.relu(self.norm2(self.conv2(y)))
        return torch.relu(self.downsample(x) + y)


class FeatureCNN(nn.Module):
    """Six residual blocks, from images to features at a quarter of their size.

    Args:
        widths: channels of the three pairs of blocks, at 1/2, 1/4 and 1/4.
        outputs: channels out (the paper's d).
    """

    mean: Tensor
    std: Tensor

    def __init__(self, widths: tuple[int, int, int] = (64, 96, 128), outputs: int = 128) -> None:
        super().__init__()
        first, second, third = widths
        self.conv1 = nn.Conv2d(3, first, 7, stride=2, padding=3, bias=False)
        self.norm1 = instance_norm(first)
        self.layer1 = nn.Sequential(ResidualBlock(first, first), ResidualBlock(first, first))
        self.layer2 = nn.Sequential(ResidualBlock(first, second, stride=2), ResidualBlock(second, second))
        self.layer3 = nn.Sequential(ResidualBlock(second, third), ResidualBlock(third, third))
        self.conv2 = nn.Conv2d(third, outputs, 1)
        self.register_buffer("mean", torch.tensor(IMAGE_MEAN)[:, None, None], persistent=False)
        self.register_buffer("std", torch.tensor(IMAGE_STD)[:, None, None], persistent=False)

    def forward(self, images: Float[Tensor, "n 3 h w"]) -> Float[Tensor, "n outputs h4 w4"]:
        """Features of images in 0..1; both sides must be multiples of 4."""
        x = (images - self.mean) / self.std
        x = torch.relu(self.norm1(self.conv1(x)))
        features: Tensor = self.conv2(self.layer3(self.layer2(self.layer1(x))))
        return features


def instance_norm(channels: int) -> nn.GroupNorm:
    """Normalise every channel of every image: a group norm with one channel per group, twice as fast as `InstanceNorm2d`."""
    return nn.GroupNorm(channels, channels, affine=False)


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


def lay_out(module: nn.Module, layout: torch.memory_format) -> None:
    """Store the kernels of a module's convolutions, 3D ones too, in a memory format; parameters stay the same objects."""
    volumes = torch.channels_last_3d if layout == torch.channels_last else layout
    for parameter in module.parameters():
        if parameter.ndim in (4, 5):
            parameter.data = parameter.data.contiguous(memory_format=layout if parameter.ndim == 4 else volumes)


def beside(*maps: Float[Tensor, "n _ h w"]) -> Float[Tensor, "n c h w"]:
    """Maps concatenated along the channels, in the memory format of the widest.

    `torch.cat` of maps in different formats takes four times as long, and the next convolution has to convert the result.
    """
    widest = max(maps, key=lambda one: one.shape[1])
    last = widest.is_contiguous(memory_format=torch.channels_last)
    layout = torch.channels_last if last else torch.contiguous_format
    return torch.cat([one.contiguous(memory_format=layout) for one in maps], dim=1)
