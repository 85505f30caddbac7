"""Peak memory of the tensors in each stage of the network.

It adds up the tensors that are in memory at the same time, in numbers per feature texel, per Gaussian and per pixel, from the network's
settings. Change it together with the forward pass, which it follows.
"""

from __future__ import annotations

from collections.abc import Callable
from contextlib import AbstractContextManager
from dataclasses import dataclass

import torch

from semgs.model.classes.mobilenet import CUE_WIDTHS, downsampled_size
from semgs.model.classes.semantic import CLOSER, SHAPE
from semgs.model.gaussians.heads import RENDERED_HARMONICS
from semgs.model.layers.network_input import WHOLE, Chunks
from semgs.model.settings import MobileNet, NetworkSettings, PaperHeads, TransformerSettings
from semgs.model.sweep.cost_volume import CHUNK
from semgs.model.sweep.upsampling import NEIGHBOURS, WIDTH
from semgs.scene.coarse_depth import SHRINK

STAGES = ("cnn", "transformer_colour", "transformer_semantic", "cost_volume", "depth", "heads")
"""The stages, in order."""

Stage = Callable[[str], AbstractContextManager[object]]
"""From a stage's name to a context manager around it."""


DRAWN_PAIRS = 30e6
"""The pairs of Gaussian and tile that are rendered at a time [bytes]."""

DRAWING = 340
"""Memory to render a view, per Gaussian of the scene: ellipse, place in the depth order, colour [bytes]."""

UNET_MAPS = 10
"""Maps of a U-Net's width in memory at its finest level: skips, and a convolution's input and output, both also in its own memory
format."""


CUES = sum(width / 4**level for level, width in enumerate(CUE_WIDTHS, 1))
"""Numbers in depth's cues per texel at 1/4."""


@dataclass(frozen=True)
class Work:
    """The work of a network.

    Attributes:
        settings: of the network.
        classes: number of its classes, 0 for colour alone.
        fuses: whether views agree on classes.
        dtype: of its parameters.
        device: on which it computes.
        views: number of input views.
        size: (height, width) after padding [px].
        drawn: number of rendered views.
        looks: at each view for its classes.
        padded: whether padding copies the images.
    """

    settings: NetworkSettings
    classes: int
    fuses: bool
    dtype: torch.dtype
    device: torch.device
    views: int
    size: tuple[int, int]
    drawn: int
    padded: bool = False
    looks: int = 1

    @property
    def number_bytes(self) -> int:
        """Bytes per number in the network's tensors."""
        return max(self.dtype.itemsize, 4)

    def texels(self, stride: int) -> float:
        """Texels of a view's grid with that stride."""
        return self.size[0] * self.size[1] / stride**2

    @property
    def gaussians(self) -> float:
        """Gaussians of all views."""
        return self.views * self.texels(self.settings.stride)

    @property
    def pixels(self) -> int:
        """Pixels of all views."""
        return self.views * self.size[0] * self.size[1]


@dataclass(frozen=True)
class Heads:
    """Memory of the heads, in numbers per Gaussian.

    Attributes:
        seen: input channels of the heads of colour and opacity.
        outputs: output channels of the colour head.
        wide: channels of the upsampled features, which are used twice.
        refined: peak of the refinement of depth.
        kept: of the refinement, until the colour head starts.
        joined: number of feature maps that are concatenated before upsampling.
        convex: peak of the convex upsampling of depth, per texel.
    """

    seen: int
    outputs: int
    wide: int = 0
    refined: int = 0
    kept: int = 0
    joined: int = 0
    convex: int = 0


def stage_bytes(work: Work, chunks: Chunks = WHOLE) -> dict[str, float]:
    """Peak memory of the tensors in each stage, without memory used before [bytes]."""
    pixels, classes = work.size[0] * work.size[1], work.classes
    maps = 5 + classes
    # All views' renderings, the largest maps of one call to `render` again while they are concatenated, the last view's layers.
    drawn = pixels * (work.drawn * maps + max(work.views, work.drawn - work.views) * max(classes, 3) + 2 * maps) * 4
    drawing = work.number_bytes * _result(work) + drawn + DRAWING * work.gaussians + DRAWN_PAIRS
    return {stage: work.number_bytes * value for stage, value in _numbers(work, chunks).items()} | {"render": drawing}


def seen_bytes(work: Work) -> float:
    """Input of the heads of colour and opacity for one view [bytes]."""
    return work.number_bytes * work.texels(work.settings.stride) * _heads(work.settings).seen


def _numbers(work: Work, chunks: Chunks) -> dict[str, float]:
    """Numbers in the tensors of each stage of the network, at its peak."""
    s, views, gaussians = work.settings, work.views, work.gaussians
    texels = views * work.texels(SHRINK)
    images = (3 * work.pixels if work.padded else 0) + (3 * gaussians if s.stride > 1 else 0)
    features = texels * s.channels

    # Half-size maps of a residual block: its input, and two convolutions and their norms.
    cnn = 5 * s.cnn_widths[0] * 4 * texels

    # The shallow and the transformed features of each branch.
    known = features * ((4 if s.semantic else 2) + s.colour.depth.cosine_cost)
    if s.semantic is not None and s.semantic.mosaic is not None:
        known += texels * s.semantic.mosaic.enlargement**2 * work.classes
    if work.looks > 1:
        known += gaussians * work.classes
    cost = known + _cost(work, texels, chunks)
    # The cost, the distribution, its largest probability and its spread.
    known += 2 * texels * s.colour.depth.candidates + 2 * gaussians
    regression = known + texels * (s.channels + 2 * s.colour.depth.candidates + UNET_MAPS * s.colour.depth.width)
    # The filtered cost and what was added to it; five maps at half the volume's sides.
    filtered = known + texels * s.colour.depth.candidates * (2 + 5 * s.colour.depth.cost_filter / 8)
    known += texels * CUES * s.colour.depth.cue

    heads = _heads(s)
    again = heads.wide if chunks.heads else 0  # computed again, and released before the head starts
    known += heads.joined * features + gaussians * ((1 if heads.refined else 0) + heads.wide - again)
    depth = max(regression, filtered, known + texels * heads.convex, known + gaussians * heads.refined)
    kept = known + gaussians * heads.kept
    # Input of the heads, their hidden layer and their output, both also in the convolution's own memory format.
    part = min(chunks.heads or views, views) / views
    last = kept + part * gaussians * (heads.seen + max(again, 2 * s.colour.hidden + 2 * heads.outputs))
    if part < 1:
        last += _result(work) * (1 + part)
    # The result, the classes of all views by row and column, their logarithms, the sums by view and together, and points in double precision.
    if work.fuses:
        last = max(last, kept + _result(work) + (4 * work.classes + 10) * gaussians)
    return {
        "cnn": images + cnn,
        "transformer_colour": images + features + _attention(s.colour.transformer, features, views),
        "transformer_semantic": images + 3 * features + max(_semantic(work, views), _second_look(work)),
        "cost_volume": images + cost,
        "depth": images + depth,
        "heads": images + last,
    }


def _attention(transformer: TransformerSettings, features: float, views: int) -> float:
    """Token maps: the larger of the feed-forward network's hidden layer, before and after its activation, and of the keys and values
    gathered from the other views."""
    return features / transformer.reduction**2 * max(4 * transformer.expansion + 14, 3 * (views - 1) + 13)


def _semantic(work: Work, views: int) -> float:
    """The transformer of the semantic branch, its refinement or its second network, whichever is largest, for so many of the views at a time."""
    semantic = work.settings.semantic
    if semantic is None:
        return 0.0
    # Texels at 1/4 of the images that the class networks read: of large images, smaller ones.
    height, width = downsampled_size(work.size, SHRINK)
    read = views * height * width / SHRINK**2
    refinement = 0.0
    if isinstance(semantic.refinement, MobileNet):
        # The widest maps of the backbone, at half the image: 16 channels in, 96 before and after padding; 96 out at 1/4.
        refinement = read * (4 * (16 + 2 * 96) + 96)
    if semantic.mosaic is not None:
        # Its images, twice, and its widest maps: at half of them 32 channels in, 96 before and after padding; 96 out at 1/4.
        refinement = max(refinement, read * semantic.mosaic.enlargement**2 * (2 * 3 * 16 + 4 * (32 + 2 * 96) + 96))
    features = views * work.texels(SHRINK) * work.settings.channels
    attention = _attention(semantic.transformer, features, views) if semantic.compares_views else 0.0
    return max(attention, refinement)


def _second_look(work: Work) -> float:
    """What a second look adds while it looks at the last view: its image, the refinement or second network, and the classes of all views."""
    if work.looks < 2:
        return 0.0
    features = work.texels(SHRINK) * work.settings.channels
    one = 3 * work.pixels / work.views + 3 * features + _semantic(work, 1)
    return CLOSER**2 * one + work.gaussians * work.classes


def _cost(work: Work, texels: float, chunks: Chunks) -> float:
    """Features gathered for every pair of views, with the sums and counts of its planes; without the compiled kernel also the features
    warped for some planes at a time, and their positions."""
    views, channels, candidates = work.views, work.settings.channels, work.settings.colour.depth.candidates
    at_once = min(chunks.cost or views, views)
    pair = 2 * channels + 2 * candidates
    if work.device.type != "cpu":
        pair += CHUNK * (2 * channels + 10) + candidates
    return texels * (views - 1) * at_once / views * pair + texels * candidates


def _heads(settings: NetworkSettings) -> Heads:
    """The memory of the heads with these settings."""
    colour, heads = settings.colour, settings.colour.heads
    outputs = SHAPE + 3 * min(colour.harmonics, RENDERED_HARMONICS)
    if isinstance(heads, PaperHeads):
        return Heads(3 + settings.channels + colour.depth.candidates, outputs)
    convex = colour.depth.upsampling == "convex"
    # The joined features. Input of the first convolution, also in its own memory format, and what it returns; or five maps of weights: logits, weights, their texels' disparities,
    # which of them are near the strongest's, and the products.
    layers = 2 * (3 * (SHRINK // settings.stride) ** 2 + heads.upsampled + NEIGHBOURS + 1) + 2 * WIDTH
    weights = 5 * NEIGHBOURS * (SHRINK // settings.stride) ** 2
    return Heads(
        seen=3 + heads.width + heads.upsampled,
        outputs=2 + outputs,
        wide=heads.upsampled,
        refined=2 * heads.projected + 5 + UNET_MAPS * heads.width,
        kept=heads.width + 4,
        joined=2,
        convex=heads.upsampled + max(layers, weights) if convex else 0,
    )


def _result(work: Work) -> float:
    """Numbers in an encoding: its Gaussians, and three maps of its views."""
    harmonics = min(work.settings.colour.harmonics, RENDERED_HARMONICS)
    semantic = SHAPE + work.classes if work.classes else 0
    return work.gaussians * (3 + 1 + SHAPE + 3 * harmonics + semantic) + 3 * work.pixels
