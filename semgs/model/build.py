"""Build a network from its settings. The order of construction matters: in this order a seed initialises the modules."""

from __future__ import annotations

from dataclasses import replace

import torch
from torch import nn

from semgs.data.tables.classes import SCANNET20, ClassTable
from semgs.model.attention.transformer import CameraTransformer, MultiViewSwin
from semgs.model.classes.mobilenet import CUE_WIDTHS, MobileNetRefinement
from semgs.model.classes.mosaic import Mosaic
from semgs.model.classes.refinement import ClassRefinement, ResidualRefinement
from semgs.model.classes.semantic import SHAPE, SemanticBranch
from semgs.model.gaussians.heads import Decoder, DepthRefinement, MVSplatDecoder, PaperDecoder
from semgs.model.gaussians.placing import LARGEST_SIGMA, SIGMA_UNIT, SMALLEST_SIGMA
from semgs.model.layers.cnn import FeatureCNN, Head, PlainUpsampler, Upsampler
from semgs.model.semgs import ColourBranch, SemGS
from semgs.model.settings import (
    MobileNet,
    MVSplatHeads,
    NetworkSettings,
    PaperHeads,
    SemanticSettings,
    TransformerSettings,
    TwoBlocks,
)
from semgs.model.sweep.cost_volume import CostFilter
from semgs.model.sweep.depth import CostRegressor, PlaneSweepDepth
from semgs.model.sweep.upsampling import ConvexUpsampling
from semgs.scene.coarse_depth import SHRINK


def build(settings: NetworkSettings, classes: ClassTable | None = SCANNET20, network: type[SemGS] = SemGS) -> SemGS:
    """An untrained network, initialised from torch's random state.

    Args:
        settings: of the network; without semantic settings it is colour-only.
        classes: the class table of the semantic branch; None builds a colour-only network.
        network: the class to make, with the constructor of `SemGS`.
    """
    if settings.semantic is None or classes is None:
        settings, classes = replace(settings, semantic=None), None
    cnn = FeatureCNN(settings.cnn_widths, settings.channels)
    colour = _colour_branch(settings)
    semantic = None
    if settings.semantic is not None and classes is not None:
        semantic = _semantic_branch(settings, settings.semantic, len(classes))
    return network(settings, classes, cnn, colour, semantic)


def _colour_branch(settings: NetworkSettings) -> ColourBranch:
    """The colour branch and depth."""
    colour, depth = settings.colour, settings.colour.depth
    transformer = _transformer(settings.channels, colour.transformer)
    regressor = CostRegressor(settings.channels, depth, CUE_WIDTHS if depth.cue else ())
    _scaled(regressor.head, depth.initial_scale)
    cost_filter = CostFilter(depth.cost_filter) if depth.cost_filter else None
    sweep = PlaneSweepDepth(regressor, depth, settings.conventions, cost_filter)
    return ColourBranch(transformer, sweep, _decoder(settings))


def _decoder(settings: NetworkSettings) -> Decoder:
    """The heads of the colour branch."""
    colour, heads = settings.colour, settings.colour.heads
    factor, last = SHRINK // settings.stride, settings.last_kernel
    outputs = SHAPE + 3 * colour.harmonics
    if isinstance(heads, PaperHeads):
        opacity = Head(colour.depth.candidates, heads.opacity_hidden, 1, last, full=True)
        head = Head(3 + settings.channels, colour.hidden, outputs, last)
        _start_at(head, slice(0, 3), settings.initial_sigma)
        return PaperDecoder(opacity, head, colour.harmonics, factor, settings.conventions)
    upsampler = Upsampler(2 * settings.channels, heads.upsampled, factor, settings.conventions.pixel_centres)
    refinement = DepthRefinement(heads)
    _scaled(refinement.to_disparity, colour.depth.initial_scale)
    head = Head(heads.width + 3 + heads.upsampled, colour.hidden, 2 + outputs, last)  # two more: offsets in the image
    _start_at(head, slice(2, 5), settings.initial_sigma)
    convex = ConvexUpsampling(heads.upsampled, factor) if colour.depth.upsampling == "convex" else None
    return MVSplatDecoder(upsampler, refinement, head, colour.harmonics, settings.conventions, convex)


def _semantic_branch(settings: NetworkSettings, semantic: SemanticSettings, classes: int) -> SemanticBranch:
    """The semantic branch. If the refinement classifies, the head starts without influence on the classes."""
    channels, heads = settings.channels, settings.colour.heads
    factor, corners = SHRINK // settings.stride, settings.conventions.pixel_centres
    cnn = FeatureCNN(settings.cnn_widths, channels) if semantic.own_cnn else None
    refinement = _refinement(semantic.refinement, channels, classes)
    transformer = _transformer(channels, semantic.transformer) if semantic.compares_views else None
    upsampler: Upsampler | PlainUpsampler
    if isinstance(heads, MVSplatHeads):
        seen = heads.upsampled
        upsampler = Upsampler(channels * (2 if semantic.compares_views else 1), seen, factor, corners)
    else:
        seen = channels
        upsampler = PlainUpsampler(factor, corners)
    head = Head(3 + seen, semantic.hidden, SHAPE + classes, settings.last_kernel)
    _start_at(head, slice(0, 3), settings.initial_sigma)
    if refinement.classifier is not None:
        for parameter in head[-1].parameters():
            parameter.data[SHAPE:] = 0
    mosaic = None
    if semantic.mosaic is not None:
        mosaic = Mosaic(classes, semantic.mosaic.share, semantic.mosaic.enlargement)
    return SemanticBranch(cnn, refinement, transformer, upsampler, head, mosaic)


def _refinement(settings: TwoBlocks | MobileNet, channels: int, classes: int) -> ClassRefinement:
    """The class refinement."""
    if isinstance(settings, MobileNet):
        return MobileNetRefinement(channels, classes, settings.width)
    return ResidualRefinement(channels)


def _transformer(channels: int, settings: TransformerSettings) -> CameraTransformer:
    """The transformer of a branch."""
    swin = MultiViewSwin(channels, settings.blocks, settings.windows, settings.expansion, settings.reduction)
    return CameraTransformer(swin, settings.camera_aware, settings.output_transform)


def _scaled(layers: nn.Sequential, factor: float) -> None:
    """Scale the random weights of the last layer."""
    layers[-1].get_parameter("weight").data.mul_(factor)


def _start_at(head: Head, channels: slice, sigma: float | None) -> None:
    """Set the bias of a head's size channels so that Gaussians start at `sigma` pixels; None changes nothing."""
    if sigma is None:
        return
    share = (sigma / (2 * SIGMA_UNIT) - SMALLEST_SIGMA) / (LARGEST_SIGMA - SMALLEST_SIGMA)
    bias = head[-1].get_parameter("bias")
    with torch.no_grad():
        bias[channels] = torch.logit(torch.tensor(share))
