"""Peak memory of the tensors in each stage of the network.

It adds up the tensors that are in memory at the same time, in numbers per feature texel, per Gaussian and per pixel, from the network's
settings. Change it together with the forward pass, which it follows.
"""

from __future__ import annotations

from dataclasses import dataclass

from semgs.model.classes.mobilenet import CUE_WIDTHS
from semgs.model.classes.semantic import SHAPE
from semgs.model.gaussians.heads import RENDERED_HARMONICS
from semgs.model.layers.chunks import WHOLE, Chunks
from semgs.model.semgs import SemGS
from semgs.model.settings import MobileNet, NetworkSettings, PaperHeads, TransformerSettings
from semgs.model.sweep.cost_volume import CHUNK
from semgs.scene.coarse_depth import SHRINK

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
        views: number of input views.
        size: (height, width) after padding [px].
        drawn: number of rendered views.
        padded: whether padding copies the images.
    """

    views: int
    size: tuple[int, int]
    drawn: int
    padded: bool = False


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
    """

    seen: int
    outputs: int
    wide: int = 0
    refined: int = 0
    kept: int = 0
    joined: int = 0


def stage_bytes(model: SemGS, work: Work, chunks: Chunks = WHOLE) -> dict[str, float]:
    """Peak memory of the tensors in each stage, without memory used before [bytes]."""
    number = _number_bytes(model)
    numbers = _numbers(model, work, chunks, next(model.parameters()).device.type == "cpu")
    count = work.views * _texels(work.size, model.stride)
    pixels = work.size[0] * work.size[1]
    classes = model.class_count
    maps = 5 + classes
    # All views' renderings, the largest maps of one call to `render` again while they are concatenated, the last view's layers.
    drawn = pixels * (work.drawn * maps + max(work.views, work.drawn - work.views) * max(classes, 3) + 2 * maps) * 4
    result = number * _result(model, count, work.views * pixels)
    drawing = result + drawn + DRAWING * count + DRAWN_PAIRS
    return {stage: number * value for stage, value in numbers.items()} | {"render": drawing}


def seen_bytes(model: SemGS, work: Work) -> float:
    """Input of the heads of colour and opacity for one view [bytes]."""
    return _number_bytes(model) * _texels(work.size, model.stride) * _heads(model.settings).seen


def _numbers(model: SemGS, work: Work, chunks: Chunks, fused: bool) -> dict[str, float]:
    """Numbers in the tensors of each stage of the network, at its peak."""
    s, views = model.settings, work.views
    texels = views * _texels(work.size, SHRINK)
    gaussians = views * _texels(work.size, model.stride)
    pixels = views * work.size[0] * work.size[1]
    images = (3 * pixels if work.padded else 0) + (3 * gaussians if model.stride > 1 else 0)
    features = texels * s.channels

    # Half-size maps of a residual block: its input, and two convolutions and their norms.
    cnn = 5 * s.cnn_widths[0] * 4 * texels

    # The shallow and the transformed features of each branch.
    known = features * ((4 if s.semantic else 2) + s.colour.depth.cosine_cost)
    cost = known + _cost(s, texels, views, chunks, fused)
    # The cost, the distribution, its largest probability and its spread.
    known += 2 * texels * s.colour.depth.candidates + 2 * gaussians
    regression = known + texels * (s.channels + 2 * s.colour.depth.candidates + UNET_MAPS * s.colour.depth.width)
    # The filtered cost and what was added to it; five maps at half the volume's sides.
    filtered = known + texels * s.colour.depth.candidates * (2 + 5 * s.colour.depth.cost_filter / 8)
    known += texels * CUES * s.colour.depth.cue

    heads = _heads(s)
    again = heads.wide if chunks.heads else 0  # computed again, and released before the head starts
    known += heads.joined * features + gaussians * ((1 if heads.refined else 0) + heads.wide - again)
    depth = max(regression, filtered, known + gaussians * heads.refined)
    kept = known + gaussians * heads.kept
    # Input of the heads, their hidden layer and their output, both also in the convolution's own memory format.
    part = min(chunks.heads or views, views) / views
    last = kept + part * gaussians * (heads.seen + max(again, 2 * s.colour.hidden + 2 * heads.outputs))
    if part < 1:
        last += _result(model, gaussians, pixels) * (1 + part)
    # The result, the classes of all views by row and column, their logarithms, the sums by view and together, and points in double precision.
    fusing = kept + _result(model, gaussians, pixels) + (4 * model.class_count + 10) * gaussians
    if model.fuses:
        last = max(last, fusing)
    return {
        "cnn": images + cnn,
        "transformer_colour": images + features + _attention(s.colour.transformer, features, views),
        "transformer_semantic": images + 3 * features + _semantic(s, features, views),
        "cost_volume": images + cost,
        "depth": images + depth,
        "heads": images + last,
    }


def _attention(transformer: TransformerSettings, features: float, views: int) -> float:
    """Token maps: the larger of the feed-forward network's hidden layer, before and after its activation, and of the keys and values
    gathered from the other views."""
    return features / transformer.reduction**2 * max(4 * transformer.expansion + 14, 3 * (views - 1) + 13)


def _semantic(settings: NetworkSettings, features: float, views: int) -> float:
    """The transformer of the semantic branch or its refinement, whichever is larger."""
    if settings.semantic is None:
        return 0.0
    refinement = 0.0
    if isinstance(settings.semantic.refinement, MobileNet):
        # The widest maps of the backbone, at half the image: 16 channels in, 96 before and after padding; 96 out at 1/4.
        refinement = features / settings.channels * (4 * (16 + 2 * 96) + 96)
    return max(_attention(settings.semantic.transformer, features, views), refinement)


def _cost(settings: NetworkSettings, texels: float, views: int, chunks: Chunks, fused: bool) -> float:
    """Features gathered for every pair of views, with the sums and counts of its planes; without the compiled kernel also the features
    warped for some planes at a time, and their positions."""
    channels, candidates = settings.channels, settings.colour.depth.candidates
    at_once = min(chunks.cost or views, views)
    pair = 2 * channels + 2 * candidates
    if not fused:
        pair += CHUNK * (2 * channels + 10) + candidates
    return texels * (views - 1) * at_once / views * pair + texels * candidates


def _heads(settings: NetworkSettings) -> Heads:
    """The memory of the heads with these settings."""
    colour, heads = settings.colour, settings.colour.heads
    outputs = SHAPE + 3 * min(colour.harmonics, RENDERED_HARMONICS)
    if isinstance(heads, PaperHeads):
        return Heads(3 + settings.channels + colour.depth.candidates, outputs)
    return Heads(
        seen=3 + heads.width + heads.upsampled,
        outputs=2 + outputs,
        wide=heads.upsampled,
        refined=2 * heads.projected + 5 + UNET_MAPS * heads.width,
        kept=heads.width + 4,
        joined=2,
    )


def _result(model: SemGS, gaussians: float, pixels: int) -> float:
    """Numbers in an encoding: its Gaussians, and three maps of its views."""
    harmonics = min(model.settings.colour.harmonics, RENDERED_HARMONICS)
    semantic = SHAPE + model.class_count if model.class_count else 0
    return gaussians * (3 + 1 + SHAPE + 3 * harmonics + semantic) + 3 * pixels


def _number_bytes(model: SemGS) -> int:
    """Bytes per number in the network's tensors."""
    return max(next(model.parameters()).element_size(), 4)


def _texels(size: tuple[int, int], stride: int) -> float:
    """Texels of a view's grid with that stride."""
    return size[0] * size[1] / stride**2
