"""Switches: parts that the paper's ablation removes and other choices, as flat fields that change a network's settings."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import Any, Literal

from semgs.model.settings import MobileNet, MosaicBeside, MVSplatHeads, NetworkSettings, PaperHeads, TwoBlocks


@dataclass(frozen=True)
class Switches:
    """Parts of the network that can be switched: those that the paper's ablation removes, readings of its text, and additions of our own."""

    shared_layers: bool = True
    """One shallow CNN for both branches (ablation Sh-Layer)."""
    windows: int = 2
    """Windows along each side of the token map; 1 is full attention (ablation Sw-Trans)."""
    windows_semantic: int = 0
    """Windows of the semantic branch if they differ from those of the colour branch; 0 for the same."""
    camera_aware_colour: bool = True
    """Camera-aware attention in the colour branch (ablation C-Inj)."""
    camera_aware_semantic: bool = True
    """Camera-aware attention in the semantic branch (ablation C-Inj)."""
    semantic_transformer: bool = True
    """A transformer over the views in the semantic branch. Off, each view's classes and the shapes of its semantic Gaussians come from that view
    alone (not in the paper)."""
    output_transform: bool = True
    """Multiply the output of attention by G; off is the paper's text."""
    paper_heads: bool = False
    """The paper's text for the heads instead of MVSplat's."""
    class_backbone: bool = False
    """Classify each view with a MobileNetV2 on the image, which can start from published weights (not in the paper), instead of the paper's
    two residual blocks. Train it with --supervision pictures first, the only stage in which its batch norms measure. With --init, all other
    layers are kept."""
    class_mosaic: bool = False
    """Classify each view with a second network as well, MOSAIC, on enlarged images (not in the paper): classes are the geometric mean of both."""
    class_fusion: bool = False
    """Outside training, let input views agree on the classes of points that several of them see (not in the paper). It has no weights."""
    cost_filter: int = 0
    """Channels of a 3D CNN that filters the cost volume, such as 16; 0 for none (not in the paper). It starts without effect, so --init
    works with weights that lack it."""
    depth_cue: bool = False
    """Let depth also see coarse maps of each view by itself, from the class backbone (not in the paper). They start without effect, so --init
    works with weights that lack them. Depth never trains the backbone."""
    depth_upsampling: Literal["bilinear", "convex"] = "bilinear"
    """How depth gets from 1/4 of the image to the Gaussians. convex: by weights over 3x3 texels that the network predicts, so depth stays sharp
    at edges (not in the paper). It starts nearly as bilinear, so --init works with weights that lack it."""


def switches_of(settings: NetworkSettings) -> Switches:
    """The switches of a network; without a semantic branch, its switches have their defaults."""
    colour, semantic = settings.colour, settings.semantic
    found = Switches(
        windows=colour.transformer.windows,
        camera_aware_colour=colour.transformer.camera_aware,
        output_transform=colour.transformer.output_transform,
        paper_heads=isinstance(colour.heads, PaperHeads),
        cost_filter=colour.depth.cost_filter,
        depth_upsampling=colour.depth.upsampling,
    )
    if semantic is None:
        return found
    return replace(
        found,
        shared_layers=not semantic.own_cnn,
        windows_semantic=0 if semantic.transformer.windows == found.windows else semantic.transformer.windows,
        camera_aware_semantic=semantic.transformer.camera_aware,
        semantic_transformer=semantic.compares_views,
        class_backbone=isinstance(semantic.refinement, MobileNet),
        class_mosaic=semantic.mosaic is not None,
        class_fusion=semantic.fusion,
        depth_cue=colour.depth.cue,
    )


def switched(settings: NetworkSettings, changes: Mapping[str, Any]) -> NetworkSettings:
    """The settings of a network with some of its switches changed.

    Args:
        settings: of the network.
        changes: values by the names of `Switches`; the others stay.

    Raises:
        TypeError: there is no switch with a name.
        ValueError: depth_cue is set without a class backbone, or convex depth_upsampling with other heads than MVSplat's.
    """
    before = switches_of(settings)
    now = replace(before, **changes)
    depth = replace(
        settings.colour.depth,
        cost_filter=now.cost_filter,
        cue=now.depth_cue,
        upsampling=now.depth_upsampling,
    )
    colour = replace(
        settings.colour,
        transformer=replace(
            settings.colour.transformer,
            camera_aware=now.camera_aware_colour,
            output_transform=now.output_transform,
            windows=now.windows,
        ),
        depth=depth,
    )
    if now.paper_heads != before.paper_heads:
        colour = replace(colour, heads=PaperHeads() if now.paper_heads else MVSplatHeads())
    semantic = settings.semantic
    if semantic is not None:
        semantic = replace(
            semantic,
            compares_views=now.semantic_transformer,
            own_cnn=not now.shared_layers,
            fusion=now.class_fusion,
            transformer=replace(
                semantic.transformer,
                camera_aware=now.camera_aware_semantic,
                output_transform=now.output_transform,
                windows=now.windows_semantic or now.windows,
            ),
        )
        if now.class_backbone != before.class_backbone:
            semantic = replace(semantic, refinement=MobileNet() if now.class_backbone else TwoBlocks())
        if now.class_mosaic != before.class_mosaic:
            semantic = replace(semantic, mosaic=MosaicBeside() if now.class_mosaic else None)
    return replace(settings, colour=colour, semantic=semantic)
