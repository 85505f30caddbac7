"""Networks for tests, called by flat names: shorter than one dataclass a part."""

from __future__ import annotations

from typing import Any

from semgs.data.tables.classes import SCANNET20, ClassTable
from semgs.model import networks
from semgs.model.build import build
from semgs.model.semgs import SemGS
from semgs.model.settings import (
    OURS,
    ColourSettings,
    DepthSettings,
    MVSplatHeads,
    NetworkSettings,
    PaperHeads,
    SemanticSettings,
    TransformerSettings,
)
from semgs.model.switches import switched

BASE = {
    "name": "base", "channels": 128, "cnn_widths": (64, 96, 128), "candidates": 128, "colour_blocks": 6, "semantic_blocks": 3,
    "windows": 2, "windows_semantic": 0, "expansion": 4, "reduction": 1, "shared_layers": True, "camera_aware_colour": True,
    "camera_aware_semantic": True, "output_transform": True, "cost_width": 128, "cost_hidden": 256, "cost_levels": 3,
    "upsampled_channels": 128, "projected_channels": 32, "refine_width": 32, "refine_levels": 5, "decoder_blocks": 2,
    "colour_hidden": 168, "semantic_hidden": 54, "paper_heads": False, "opacity_hidden": 32, "last_kernel": 3, "harmonics": 25,
    "colour_from_image": False, "gaussian_stride": 1, "cosine_cost": False, "cost_prior": False, "initial_sigma": None,
    "initial_depth_scale": 1.0, "conventions": OURS,
}  # fmt: skip
"""The preset `base`."""


def network(classes: ClassTable | None = SCANNET20, **changes: object) -> SemGS:
    """`base` with some of its settings changed."""
    unknown = changes.keys() - BASE.keys()
    assert not unknown, unknown
    return build(settings(BASE | changes, semantic=classes is not None), classes)


def settings(flat: dict[str, Any], semantic: bool = True) -> NetworkSettings:
    """The settings of a network from all of the flat ones, with or without a semantic branch."""

    def transformer(branch: str) -> TransformerSettings:
        return TransformerSettings(
            blocks=flat[f"{branch}_blocks"],
            windows=(branch == "semantic" and flat["windows_semantic"]) or flat["windows"],
            expansion=flat["expansion"],
            reduction=flat["reduction"],
            camera_aware=flat[f"camera_aware_{branch}"],
            output_transform=flat["output_transform"],
        )

    depth = DepthSettings(
        candidates=flat["candidates"],
        width=flat["cost_width"],
        hidden=flat["cost_hidden"],
        levels=flat["cost_levels"],
        decoder_blocks=flat["decoder_blocks"],
        cosine_cost=flat["cosine_cost"],
        cost_prior=flat["cost_prior"],
        initial_scale=flat["initial_depth_scale"],
    )
    mvsplat = MVSplatHeads(
        upsampled=flat["upsampled_channels"],
        projected=flat["projected_channels"],
        width=flat["refine_width"],
        levels=flat["refine_levels"],
        decoder_blocks=flat["decoder_blocks"],
    )
    colour = ColourSettings(
        transformer=transformer("colour"),
        depth=depth,
        heads=PaperHeads(flat["opacity_hidden"]) if flat["paper_heads"] else mvsplat,
        hidden=flat["colour_hidden"],
        harmonics=flat["harmonics"],
        from_image=flat["colour_from_image"],
    )
    branch = SemanticSettings(
        transformer=transformer("semantic"), own_cnn=not flat["shared_layers"], hidden=flat["semantic_hidden"]
    )
    return NetworkSettings(
        name=flat["name"],
        channels=flat["channels"],
        cnn_widths=flat["cnn_widths"],
        stride=flat["gaussian_stride"],
        last_kernel=flat["last_kernel"],
        initial_sigma=flat["initial_sigma"],
        colour=colour,
        semantic=branch if semantic else None,
        conventions=flat["conventions"],
    )


def preset(name: str, **changes: object) -> SemGS:
    """The network of a preset, or that with some of its switches set."""
    return build(switched(networks.NETWORKS[name](), changes))
