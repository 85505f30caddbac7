"""The shallow CNN that both branches share, and the residual blocks that refine its features for semantics.

Layer shapes and names are those of MVSplat's backbone (UniMatch's encoder), so that its weights load.
"""

from __future__ import annotations

import torch
from jaxtyping import Float
from torch import Tensor, nn

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
