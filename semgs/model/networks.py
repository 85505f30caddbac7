"""The networks that have names, as functions that return settings. No torch."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from typing import Literal, get_args

from semgs.model.settings import (
    MVSPLAT,
    ColourSettings,
    Conventions,
    DepthSettings,
    MVSplatHeads,
    NetworkSettings,
    PaperHeads,
    SemanticSettings,
    TransformerSettings,
)
from semgs.model.switches import Switches, switched, switches_of


def base() -> NetworkSettings:
    """The paper's sizes; colour branch and depth have MVSplat's layer shapes."""
    return NetworkSettings(name="base")


def base_text() -> NetworkSettings:
    """`base` with the paper's text taken literally; docs/method.md lists what that changes."""
    start = base()
    transformer, semantic = start.colour.transformer, SemanticSettings()
    return replace(
        start,
        name="base_text",
        colour=replace(start.colour, transformer=replace(transformer, output_transform=False), heads=PaperHeads()),
        semantic=replace(semantic, transformer=replace(semantic.transformer, output_transform=False)),
        conventions=Conventions(candidates="linear"),
    )


def small_plain() -> NetworkSettings:
    """The same modules for a laptop's CPU; docs/method.md has a table of its differences from `base`."""
    return NetworkSettings(
        name="small_plain",
        channels=48,
        cnn_widths=(16, 32, 48),
        stride=2,
        last_kernel=1,
        initial_sigma=0.5,
        colour=ColourSettings(
            transformer=TransformerSettings(blocks=3, expansion=2, reduction=2),
            depth=DepthSettings(
                candidates=64, width=32, hidden=32, decoder_blocks=1, cosine_cost=True, cost_prior=True, initial_scale=0.1
            ),
            heads=MVSplatHeads(upsampled=32, projected=16, width=16, levels=4, decoder_blocks=1),
            hidden=32,
            harmonics=4,
            from_image=True,
            shrink_seen=0.5,
        ),
        semantic=SemanticSettings(transformer=TransformerSettings(blocks=2, expansion=2, reduction=2), hidden=32),
    )  # fmt: skip


def small() -> NetworkSettings:
    """The network of the included weights without their second network for classes (`class_mosaic`): `small_plain` with a class backbone, on whose classes views agree,
    instead of the semantic transformer, and with more layers in depth."""
    changes = {
        "class_backbone": True, "class_fusion": True, "semantic_transformer": False, "cost_filter": 16, "depth_cue": True, "depth_upsampling": "convex",
    }  # fmt: skip
    return replace(switched(small_plain(), changes), name="small")


def mvsplat() -> NetworkSettings:
    """MVSplat's encoder as published: colour only, without camera-aware attention, with its own conventions."""
    return NetworkSettings(
        name="mvsplat",
        colour=ColourSettings(transformer=TransformerSettings(blocks=6, camera_aware=False)),
        semantic=None,
        conventions=MVSPLAT,
    )


NetworkName = Literal["small", "small_plain", "base", "base_text", "mvsplat"]

NAMES: tuple[NetworkName, ...] = get_args(NetworkName)

NETWORKS: dict[str, Callable[[], NetworkSettings]] = dict(
    zip(NAMES, (small, small_plain, base, base_text, mvsplat), strict=True)
)
"""By their names."""


def named_switches(name: str) -> Switches:
    """The switches of the network of that name."""
    return switches_of(NETWORKS[name]())
