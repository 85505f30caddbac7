"""Presets: the networks that have names. A preset is a function that builds one."""

from __future__ import annotations

from semgs.data.classes import SCANNET20, ClassTable
from semgs.model.conventions import MVSPLAT
from semgs.model.semgs import SemGS

NAMES = ("small", "base", "mvsplat")


def base(classes: ClassTable = SCANNET20) -> SemGS:
    """The paper's sizes; its colour branch and depth have MVSplat's layer shapes."""
    return SemGS(classes=classes, name="base")


def small(classes: ClassTable = SCANNET20) -> SemGS:
    """The same modules for a laptop's CPU; its differences from `base` are a table in docs/method.md."""
    return SemGS(
        classes=classes,
        channels=48,
        cnn_widths=(16, 32, 48),
        candidates=64,
        colour_blocks=3,
        semantic_blocks=2,
        expansion=2,
        reduction=2,
        cost_width=32,
        cost_hidden=32,
        upsampled_channels=32,
        projected_channels=16,
        refine_width=16,
        refine_levels=4,
        decoder_blocks=1,
        colour_hidden=32,
        semantic_hidden=32,
        last_kernel=1,
        harmonics=4,
        colour_from_image=True,
        gaussian_stride=2,
        cosine_cost=True,
        cost_prior=True,
        initial_sigma=0.5,
        initial_depth_scale=0.1,
        name="small",
    )


def mvsplat() -> SemGS:
    """MVSplat's encoder as published: colour only, without camera-aware attention, with its own conventions."""
    return SemGS(
        classes=None,
        camera_aware_colour=False,
        camera_aware_semantic=False,
        conventions=MVSPLAT,
        name="mvsplat",
    )
