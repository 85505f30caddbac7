"""Conventions: the differences between MVSplat's geometry and ours, each as a named choice.

The defaults are ours. MVSplat's published weights were trained with its own conventions, so only the network `mvsplat` uses them
(`MVSPLAT`). The labels D2-D8 are those of `docs/method.md`, which shows the effect of each.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal


@dataclass(frozen=True)
class Conventions:
    """Named choices of geometry.

    Attributes:
        own_intrinsics: the plane sweep projects into a source view with that view's own K; else with the reference
            view's (D2).
        z_depth: the predicted depth is z-depth when points are placed; else the distance along the unit ray (D3).
        standard_harmonics: predicted harmonics are in the 3DGS basis of the camera's frame; else in MVSplat's basis (D4).
        pixel_centres: feature texels are at .5 in the plane sweep and bilinear upsampling keeps image corners; else
            texels are at integers and upsampling keeps the centres of the corner texels (D6).
        mask_unseen: samples behind or outside a source view do not count in the mean; else their depth is clamped to
            1e-3 and what lies outside is zero.
        relative_disparity: the refinement reads disparity times the near bound and corrects it in units of 1 / near;
            else both are in 1 / m (D8).
        candidates: depth candidates uniform in inverse depth, or in depth (the paper's words).
    """

    own_intrinsics: bool = True
    z_depth: bool = True
    standard_harmonics: bool = True
    pixel_centres: bool = True
    mask_unseen: bool = True
    relative_disparity: bool = True
    candidates: Literal["inverse", "linear"] = "inverse"


OURS = Conventions()
MVSPLAT = Conventions(
    own_intrinsics=False,
    z_depth=False,
    standard_harmonics=False,
    pixel_centres=False,
    mask_unseen=False,
    relative_disparity=False,
)
