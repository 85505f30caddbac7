"""MOSAIC on the image: a second network for the classes of single views, which can start from published weights.

Wang and Howard, "MOSAIC: Mobile Segmentation via decoding Aggregated Information and encoded Context" (2021), as MLCommons published it
(mobile_open, segmenter R4) for the 31 most frequent classes of ADE20K. Batch norms are folded into the convolutions, as in the published
file. Its parameters have the names in that file, except for the last three: the translation from the published classes to the
network's own, and two heads that add to its result.
"""

from __future__ import annotations

from dataclasses import dataclass

import torch
from jaxtyping import Float
from torch import Tensor, nn
from torch.nn.functional import avg_pool2d, conv2d, interpolate, pad, relu

from semgs.model.classes.mobilenet import SameConv2d, downsampled_size
from semgs.runtime.precision import in_full, outside_autocast
from semgs.scene.coarse_depth import SHRINK

PUBLISHED = 32
"""Classes of the published network; the first one stands for everything else."""

STEM = 32
"""Channels of the first convolution, at 1/2 of the image."""


@dataclass(frozen=True)
class Block:
    """Sizes of one inverted residual block.

    Attributes:
        wide: channels between its 1x1 convolutions.
        kernel, stride, dilation: of the convolution of each channel.
        outputs: channels out.
    """

    wide: int
    kernel: int
    stride: int
    dilation: int
    outputs: int


LAYOUT = (
    Block(96, 3, 2, 1, 32), Block(64, 3, 1, 1, 32),
    Block(160, 5, 2, 1, 64), Block(192, 3, 1, 1, 64), Block(128, 3, 1, 1, 64), Block(192, 3, 1, 1, 64),
    Block(384, 5, 2, 1, 128), Block(384, 3, 1, 1, 128), Block(384, 3, 1, 1, 128), Block(384, 3, 1, 1, 128),
    Block(768, 3, 1, 1, 160), Block(640, 3, 1, 1, 160), Block(960, 3, 1, 1, 192),
    Block(384, 5, 1, 2, 96), Block(384, 5, 1, 2, 96), Block(384, 5, 1, 2, 96),
)  # fmt: skip

FINE, MIDDLE = 1, 5
"""Blocks whose wide maps, before the last 1x1 convolution, the decoder reads: at 1/4 and 1/8 of the image."""

WINDOWS = (8, 4, 2)
"""Sides of the windows over which the levels of the context take means, in texels at 1/16."""

DEPTH = 64
"""Channels of the finest wide map, of the decoder and of each half of a level of the context."""


OWN_LAYERS = ("translation.", "own.", "own_low.", "mixture.")
"""Beginnings of the names of tensors that the published file lacks."""

SMALLEST = 1e-9
"""Probabilities of classes below this count as this."""


class InvertedResidual(nn.Module):
    """Widen by 1x1, convolve each channel, narrow by 1x1; ReLU after the first two, none after the last.

    Args:
        inputs: channels in; if they equal the outputs and the stride is 1, the input is added.
        block: its sizes.
    """

    def __init__(self, inputs: int, block: Block) -> None:
        super().__init__()
        wide = block.wide
        self.expand = SameConv2d(inputs, wide)
        self.depthwise = SameConv2d(wide, wide, block.kernel, block.stride, wide, block.dilation)
        self.project = SameConv2d(wide, block.outputs)
        self.residual = block.stride == 1 and inputs == block.outputs

    def forward(
        self, x: Float[Tensor, "n inputs h w"]
    ) -> tuple[Float[Tensor, "n outputs h2 w2"], Float[Tensor, "n wide h2 w2"]]:
        """The output, and the wide map before the last convolution."""
        wide = relu(self.depthwise(relu(self.expand(x), inplace=True)), inplace=True)
        y = self.project(wide)
        return x + y if self.residual else y, wide


class ContextLevel(nn.Module):
    """Context of one size: means over windows, half of the channels convolved by 3x3 and half by 5x5, enlarged again.

    Args:
        inputs: channels in.
        window: side of the windows, in texels.
    """

    def __init__(self, inputs: int, window: int) -> None:
        super().__init__()
        self.window, half = window, inputs // 2
        self.depthwise3, self.pointwise3 = SameConv2d(half, half, 3, groups=half), SameConv2d(half, DEPTH)
        self.depthwise5, self.pointwise5 = SameConv2d(half, half, 5, groups=half), SameConv2d(half, DEPTH)

    def forward(self, x: Float[Tensor, "n inputs h w"]) -> Float[Tensor, "n outputs h w"]:
        """128 channels of the same size."""
        near, far = window_means(x, self.window).chunk(2, 1)
        near = relu(self.pointwise3(relu(self.depthwise3(near))))
        far = relu(self.pointwise5(relu(self.depthwise5(far))))
        return enlarge(torch.cat((near, far), 1), self.window, x)


class Translation(nn.Module):
    """From logits of one set of classes to log-probabilities of another: log sum_k p_k t_ck, with the softmax t_ck over the new classes c.

    Args:
        known: number of classes of the logits.
        classes: number of new classes; all are equally likely at first.
    """

    def __init__(self, known: int, classes: int) -> None:
        super().__init__()
        self.weight = nn.Parameter(torch.zeros(classes, known))

    @outside_autocast
    def forward(self, logits: Float[Tensor, "n known h w"]) -> Float[Tensor, "n class h w"]:
        """Log-probabilities of the new classes, in the precision of the weights."""
        probabilities = logits.to(self.weight.dtype).softmax(1)
        translated: Tensor = conv2d(probabilities, self.weight.softmax(0)[..., None, None])
        return translated.clamp(min=SMALLEST).log()


class GeometricMean(nn.Module):
    """The geometric mean of two class distributions, among the classes that the second network knows; the first one alone decides how likely the
    others are.

    Args:
        classes: number of classes; the second network knows all of them at first.
        share: of the second network.
    """

    def __init__(self, classes: int, share: float) -> None:
        super().__init__()
        self.share = share
        self.register_buffer("known", torch.ones(classes, dtype=torch.bool))

    @outside_autocast
    def forward(
        self, first: Float[Tensor, "n class h w"], second: Float[Tensor, "n class h w"]
    ) -> Float[Tensor, "n class h w"]:
        """Log-probabilities, from logits of both networks.

        With the probabilities p and q, those of known classes are p^(1 - w) q^w, scaled to the sum that p has over them; all others are p.
        """
        first, second = (in_full(maps).log_softmax(1) for maps in (first, second))
        known = self.get_buffer("known")[:, None, None]
        mean = (1 - self.share) * first + self.share * second
        mass, total = (maps.masked_fill(~known, -torch.inf).logsumexp(1, keepdim=True) for maps in (first, mean))
        return torch.where(known, mean - total + mass, first)


class Mosaic(nn.Module):
    """The network (1.9 million parameters), and how its classes join those of another one.

    Args:
        classes: number of classes of its logits.
        share: in the mean of both (`mixture`).
        enlargement: of its images, relative to those that the MobileNet reads (`downsample`).
    """

    def __init__(self, classes: int, share: float = 0.4, enlargement: float = 1.6) -> None:
        super().__init__()
        self.enlargement = enlargement
        self.stem = SameConv2d(3, STEM, 3, stride=2)
        widths = (STEM, *(block.outputs for block in LAYOUT))
        self.blocks = nn.ModuleList(InvertedResidual(*sizes) for sizes in zip(widths[:-1], LAYOUT, strict=True))
        self.top = SameConv2d(widths[-1], 448)
        self.pyramid = nn.ModuleList(ContextLevel(448, window) for window in WINDOWS)
        self.context = SameConv2d(448 + 2 * DEPTH * len(WINDOWS), 128)
        self.merge = SameConv2d(128 + LAYOUT[MIDDLE].wide, DEPTH)
        self.refine = SameConv2d(DEPTH, DEPTH, 3, groups=DEPTH)
        self.classes = SameConv2d(DEPTH, PUBLISHED)
        self.low = SameConv2d(DEPTH, PUBLISHED)
        for name, parameter in self.named_parameters():
            # Without norms, features would fade with PyTorch's own initialisation.
            if name.endswith("bias"):
                nn.init.zeros_(parameter)
            else:
                nn.init.kaiming_normal_(parameter, nonlinearity="relu")
        self.translation = Translation(PUBLISHED, classes)
        self.mixture = GeometricMean(classes, share)
        self.own = SameConv2d(DEPTH, classes)
        self.own_low = SameConv2d(DEPTH, classes)
        for layer in (self.own, self.own_low):
            for parameter in layer.parameters():
                nn.init.zeros_(parameter)

    def forward(self, images: Float[Tensor, "n 3 h w"]) -> Float[Tensor, "n class h4 w4"]:
        """Logits of the classes at 1/4 (rounded up) of the enlarged images, in float32: the published network's classes, translated, plus what
        the own heads add.

        Args:
            images: of any size, in 0..1.
        """
        (fine, middle), x = self._encode(self.enlarged(images))
        x = enlarge(x, 2, middle)
        x = relu(self.refine(relu(self.merge(torch.cat((x, middle), 1)))))
        published = relu(self.low(fine)) + enlarge(relu(self.classes(x)), 2, fine)
        own = self.own_low(fine) + enlarge(self.own(x), 2, fine)
        logits: Tensor = self.translation(published) + own
        return logits

    def enlarged(self, images: Float[Tensor, "n 3 h w"]) -> Float[Tensor, "n 3 h2 w2"]:
        """The images at the size that the network reads."""
        height, width = (round(self.enlargement * side) for side in downsampled_size(images.shape[-2:], SHRINK))
        if height < images.shape[-2]:
            return interpolate(images, (height, width), mode="area")
        return interpolate(images, (height, width), mode="bilinear", align_corners=False)

    def class_layers(self) -> tuple[nn.Module, ...]:
        """Layers that depend on the classes."""
        return self.translation, self.mixture, self.own, self.own_low

    def pretrained_layers(self) -> tuple[nn.Module, ...]:
        """Layers that the published weights have."""
        own = self.class_layers()
        return tuple(layer for layer in self.children() if layer not in own)

    def _encode(self, images: Float[Tensor, "n 3 h w"]) -> tuple[list[Tensor], Float[Tensor, "n 128 h16 w16"]]:
        """The wide maps that the decoder reads, 64 channels at 1/4 and 192 at 1/8; and the coarsest map with its context."""
        x = (255 * images - 128) / 127.5
        x = relu(self.stem(x.contiguous(memory_format=torch.channels_last)))
        read = []
        for k, block in enumerate(self.blocks):
            x, wide = block(x)
            if k in (FINE, MIDDLE):
                read.append(wide)
        x = relu(self.top(x))
        return read, relu(self.context(torch.cat([*(level(x) for level in self.pyramid), x], 1)))


def window_means(x: Float[Tensor, "n c h w"], side: int) -> Float[Tensor, "n c h2 w2"]:
    """Means over windows of that side; those that reach past the map are means of what they cover."""
    return avg_pool2d(x, side, ceil_mode=True, count_include_pad=False)


def enlarge(x: Float[Tensor, "n c h w"], times: int, like: Float[Tensor, "n _ h2 w2"]) -> Float[Tensor, "n c h2 w2"]:
    """A map `times` as large, bilinear, cut to the size of another one: texel i of the result is at i / times of the map.

    That is TensorFlow 1's way of resizing, without half a pixel's shift; past the last texel, the map continues unchanged.
    """
    height, width = (times * side + 1 for side in x.shape[-2:])
    x = pad(x, (0, 1, 0, 1), mode="replicate")
    x = interpolate(x, (height, width), mode="bilinear", align_corners=True)
    return x[..., : like.shape[-2], : like.shape[-1]]
