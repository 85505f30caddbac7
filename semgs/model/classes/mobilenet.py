"""MobileNetV2 on the image, and a light decoder: the class branch that can start from published weights.

Sandler et al., "MobileNetV2: Inverted Residuals and Linear Bottlenecks" (CVPR 2018), table 2 at width 1.0. Batch norms are folded into
the convolutions, as in the published files, so the backbone has no norms. Its parameters have the names in these files.
"""

from __future__ import annotations

from collections.abc import Sequence

import torch
from jaxtyping import Float
from torch import Tensor, nn
from torch.nn.functional import interpolate, pad, relu6

from semgs.model.classes.refinement import ClassRefinement, Cues, Shallow, ViewFeatures
from semgs.model.layers.cnn import lay_out
from semgs.scene.coarse_depth import SHRINK

SIDE = 240
"""Shorter side of the images that the class branch is trained for [px]; things look different at twice the size."""

STEM = 32
"""Channels of the first convolution, at 1/2 of the image."""

LAYOUT = (
    (1, 16, 1, 1), (6, 24, 2, 2), (6, 32, 3, 2), (6, 64, 4, 2), (6, 96, 3, 1), (6, 160, 3, 2), (6, 320, 1, 1),
)  # fmt: skip
"""Groups of blocks: expansion, output channels, number of blocks, stride of the first."""

TAPS = (2, 5, 12, 16)
"""Blocks whose outputs the decoder reads: the last ones at 1/4, 1/8, 1/16 and 1/32 of the image."""

WIDTHS = (24, 32, 96, 320)
"""Channels of those outputs."""

CUES = (1, 2)
"""Which of the outputs depth may see: those at 1/8 and 1/16."""

CUE_WIDTHS = tuple(WIDTHS[k] for k in CUES)
"""Their channels."""


class SameConv2d(nn.Conv2d):
    """A convolution with bias and TensorFlow's SAME padding: ceil(n / stride) texels from n, with an odd zero at the far side.

    With stride 2 and a 3x3 kernel an even side is padded by 0 before and 1 after, an odd one by 1 and 1.

    Args:
        inputs: channels in.
        outputs: channels out.
        kernel: side of the kernel.
        stride: step between two positions, in texels.
        groups: as for `nn.Conv2d`.
        dilation: step between two taps of the kernel, in texels; more than 1 only with stride 1.
    """

    def __init__(
        self, inputs: int, outputs: int, kernel: int = 1, stride: int = 1, groups: int = 1, dilation: int = 1
    ) -> None:
        padding = dilation * (kernel // 2) if stride == 1 else 0
        super().__init__(inputs, outputs, kernel, stride, padding, dilation, groups)

    def forward(self, x: Float[Tensor, "n inputs h w"]) -> Float[Tensor, "n outputs h2 w2"]:
        """The convolved map."""
        if self.stride[0] > 1:
            x = pad(x, (*self._around(x.shape[-1]), *self._around(x.shape[-2])))
        convolved: Tensor = super().forward(x)
        return convolved

    def _around(self, side: int) -> tuple[int, int]:
        """Zeros before and after a side of that many texels."""
        kernel, stride = self.kernel_size[0], self.stride[0]
        total = max((-(-side // stride) - 1) * stride + kernel - side, 0)
        return total // 2, total - total // 2


class InvertedResidual(nn.Module):
    """Widen by 1x1, convolve each channel with 3x3, narrow by 1x1; ReLU6 after the first two, none after the last.

    Args:
        inputs: channels in.
        outputs: channels out; if they equal `inputs` and the stride is 1, the input is added.
        expansion: intermediate channels relative to `inputs`; 1 leaves out the first convolution.
        stride: of the 3x3.
    """

    def __init__(self, inputs: int, outputs: int, expansion: int, stride: int) -> None:
        super().__init__()
        wide = expansion * inputs
        self.expand = SameConv2d(inputs, wide) if expansion > 1 else None
        self.depthwise = SameConv2d(wide, wide, 3, stride, groups=wide)
        self.project = SameConv2d(wide, outputs)
        self.residual = stride == 1 and inputs == outputs

    def forward(self, x: Float[Tensor, "n inputs h w"]) -> Float[Tensor, "n outputs h2 w2"]:
        """Features of the same size, or of half of it (rounded up) with stride 2."""
        y = x if self.expand is None else relu6(self.expand(x), inplace=True)
        narrow: Tensor = self.project(relu6(self.depthwise(y), inplace=True))
        return x + narrow if self.residual else narrow


class MobileNetV2(nn.Module):
    """The convolutions of MobileNetV2 1.0 up to 320 channels (1.80 million parameters), without the 1,280 channels and the classifier."""

    def __init__(self) -> None:
        super().__init__()
        self.stem = SameConv2d(3, STEM, 3, stride=2)
        blocks, inputs = [], STEM
        for expansion, outputs, count, stride in LAYOUT:
            for k in range(count):
                blocks.append(InvertedResidual(inputs, outputs, expansion, stride if k == 0 else 1))
                inputs = outputs
        self.blocks = nn.ModuleList(blocks)
        for name, parameter in self.named_parameters():
            # Without norms, features would fade with PyTorch's own initialisation.
            if name.endswith("bias"):
                nn.init.zeros_(parameter)
            else:
                nn.init.kaiming_normal_(parameter, nonlinearity="relu")

    def forward(self, images: Float[Tensor, "n 3 h w"]) -> list[Float[Tensor, "n c hk wk"]]:
        """Maps of 24, 32, 96 and 320 channels at 1/4, 1/8, 1/16 and 1/32 (rounded up) of images in 0..1."""
        x = (255 * images - 128) / 128
        x = relu6(self.stem(x.contiguous(memory_format=torch.channels_last)), inplace=True)
        maps = []
        for k, block in enumerate(self.blocks):
            x = block(x)
            if k in TAPS:
                maps.append(x)
        return maps


class MobileNetRefinement(ClassRefinement):
    """Class features from the image: MobileNetV2 and a decoder that sums its maps from coarse to fine.

    Only the decoder has batch norm. The shallow features are not used, because they are made to match points between views.
    Its convolutions use channels last in training too, which halves the time of a step.

    Args:
        channels: of the features for the transformer.
        classes: number of classes.
        width: channels in the decoder.
    """

    reads_shallow = False

    def __init__(self, channels: int, classes: int, width: int = 96) -> None:
        super().__init__()
        self.backbone = MobileNetV2()
        self.lateral = nn.ModuleList(conv_norm_relu(nn.Conv2d(wide, width, 1, bias=False)) for wide in WIDTHS)
        self.merged = nn.ModuleList(
            conv_norm_relu(nn.Conv2d(width, width, 3, padding=1, groups=width, bias=False)) for _ in WIDTHS[:-1]
        )
        self.last = conv_norm_relu(nn.Conv2d(width, width, 3, padding=1, bias=False))
        self.features = nn.Conv2d(width, channels, 1)
        self.classifier = nn.Conv2d(width, classes, 1)

    def train(self, mode: bool = True) -> MobileNetRefinement:
        """Set the mode, as for every module, and keep the memory format."""
        super().train(mode)
        lay_out(self, torch.channels_last)
        return self

    def forward(self, images: Float[Tensor, "n 3 h w"], shallow: Shallow) -> ViewFeatures:
        """Features at 1/4 of the images, and the evidence for classes. Large images are downsampled first (`downsample`)."""
        maps = self.backbone(downsample(images, SHRINK))
        x = resample(self.decode(maps), images, SHRINK)
        return ViewFeatures(self.features(x), x, tuple(maps[k] for k in CUES))

    def cues(self, images: Float[Tensor, "n 3 h w"], cue_maps: tuple[Tensor, ...] = ()) -> Cues:
        """The backbone's maps of 32 and 96 channels: depth reads them and never teaches them.

        They are contiguous, because torch 2.13 crashes in the gradient of a group norm on maps with channels last and without gradient.
        """
        if not cue_maps:
            with torch.no_grad():
                maps = self.backbone(downsample(images, SHRINK))
            cue_maps = tuple(maps[k] for k in CUES)
        detached = (cue_map.detach().contiguous() for cue_map in cue_maps)
        return tuple(resample(cue_map, images, SHRINK * 2**k) for k, cue_map in zip(CUES, detached, strict=True))

    def evidence_layers(self) -> tuple[nn.Module, ...]:
        """Layers on which the classifier's logits depend, the classifier included."""
        assert self.classifier is not None
        return self.backbone, self.lateral, self.merged, self.last, self.classifier

    def cue_layers(self) -> tuple[nn.Module, ...]:
        """The backbone."""
        return (self.backbone,)

    def pretrained_layers(self) -> tuple[nn.Module, ...]:
        """The backbone."""
        return (self.backbone,)

    def decode(self, maps: list[Tensor]) -> Float[Tensor, "n width h4 w4"]:
        """The decoder's finest map, at 1/4 of the backbone's images; classes and features are linear in it."""
        *finer, coarsest = (lateral(wide) for lateral, wide in zip(self.lateral, maps, strict=True))
        x = coarsest
        for merged, fine in zip(reversed(self.merged), reversed(finer), strict=True):
            x = merged(fine + interpolate(x, size=fine.shape[-2:], mode="bilinear", align_corners=False))
        finest: Tensor = self.last(x)
        return finest


def downsample(images: Float[Tensor, "n 3 h w"], shrink: int) -> Float[Tensor, "n 3 h_small w_small"]:
    """Images downsampled by the integer that brings their shorter side closest to `SIDE`, to multiples of `shrink`; small ones are unchanged."""
    size = downsampled_size(images.shape[-2:], shrink)
    return images if size == images.shape[-2:] else interpolate(images, size=size, mode="area")


def downsampled_size(size: Sequence[int], shrink: int) -> tuple[int, int]:
    """The (height, width) of `downsample`'s result for images of that size [px]."""
    times = max(1, round(min(size) / SIDE))
    height, width = (side if times == 1 else shrink * -(-side // (shrink * times)) for side in size)
    return height, width


def conv_norm_relu(conv: nn.Conv2d) -> nn.Sequential:
    """relu(norm(conv(x)))."""
    return nn.Sequential(conv, nn.BatchNorm2d(conv.out_channels), nn.ReLU())


def resample(
    maps: Float[Tensor, "n c h2 w2"], images: Float[Tensor, "n 3 h w"], shrink: int
) -> Float[Tensor, "n c hs ws"]:
    """Maps resampled to 1 / shrink of the images, unless they have that size already."""
    size = (images.shape[-2] // shrink, images.shape[-1] // shrink)
    if size == maps.shape[-2:]:
        return maps
    return interpolate(maps, size=size, mode="bilinear", align_corners=False)
