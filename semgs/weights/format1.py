"""Format 1 of weights files, from before the network was composed of parts: flat settings and other names of tensors.

These files still load but are no longer written.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from torch import Tensor

from semgs.model.settings import NetworkSettings

PREFIXES = {
    "colour_transformer.": "colour.transformer.swin.",
    "cost_regressor.": "colour.depth.regressor.",
    "colour_upsampler.": "colour.heads.upsampler.",
    "depth_refinement.": "colour.heads.refinement.",
    "opacity_head.": "colour.heads.opacity.",
    "colour_head.": "colour.heads.colour.",
    "semantic_cnn.": "semantic.cnn.",
    "semantic_refinement.0.": "semantic.refinement.residual.0.",
    "semantic_refinement.1.": "semantic.refinement.residual.1.",
    "semantic_refinement.classes.": "semantic.refinement.classifier.",
    "semantic_refinement.": "semantic.refinement.",
    "semantic_transformer.": "semantic.transformer.swin.",
    "semantic_upsampler.": "semantic.upsampler.",
    "semantic_head.": "semantic.head.",
}
"""Beginnings of tensor names in format 1 and today. The rest is the same, and so are all other names."""


def todays_name(name: str) -> str:
    """Today's name of a tensor of format 1."""
    for first, today in PREFIXES.items():
        if name.startswith(first):
            return today + name.removeprefix(first)
    return name


def todays_tensors(tensors: Mapping[str, Tensor]) -> dict[str, Tensor]:
    """Tensors of format 1 under today's names."""
    return {todays_name(name): tensor for name, tensor in tensors.items()}


def todays_settings(flat: Mapping[str, Any], semantic: bool = True) -> NetworkSettings:
    """The settings of a file of format 1.

    Args:
        flat: the settings in its header.
        semantic: whether the file has a class table, and so a semantic branch.

    Raises:
        KeyError, TypeError, ValueError: these are not settings of format 1.
    """
    # The oldest files lack these three.
    s = {"paper_heads": False, "opacity_hidden": 32, "semantic_pyramid": (), **flat}
    for flag in ("paper_heads", "shared_layers"):
        if not isinstance(s[flag], bool):
            raise ValueError(f"{flag} is {s[flag]!r:.60}; expected bool")

    def transformer(branch: str) -> dict[str, Any]:
        return {
            "blocks": s[f"{branch}_blocks"],
            "windows": s["windows"],
            "expansion": s["expansion"],
            "reduction": s["reduction"],
            "camera_aware": s[f"camera_aware_{branch}"],
            "output_transform": s["output_transform"],
        }

    depth = {
        "candidates": s["candidates"],
        "width": s["cost_width"],
        "hidden": s["cost_hidden"],
        "levels": s["cost_levels"],
        "decoder_blocks": s["decoder_blocks"],
        "cosine_cost": s["cosine_cost"],
        "cost_prior": s["cost_prior"],
        "initial_scale": s["initial_depth_scale"],
    }
    mvsplat = {
        "kind": "mvsplat",
        "upsampled": s["upsampled_channels"],
        "projected": s["projected_channels"],
        "width": s["refine_width"],
        "levels": s["refine_levels"],
        "decoder_blocks": s["decoder_blocks"],
    }
    colour = {
        "transformer": transformer("colour"),
        "depth": depth,
        "heads": {"kind": "paper", "opacity_hidden": s["opacity_hidden"]} if s["paper_heads"] else mvsplat,
        "hidden": s["colour_hidden"],
        "harmonics": s["harmonics"],
        "from_image": s["colour_from_image"],
        "shrink_seen": 0.5 if s["name"] == "small" else 0.0,  # format 1 is older than this rule
    }
    widths = s["semantic_pyramid"]
    branch = {
        "transformer": transformer("semantic"),
        "refinement": {"kind": "pyramid", "widths": widths} if widths else {"kind": "two_blocks"},
        "own_cnn": not s["shared_layers"],
        "hidden": s["semantic_hidden"],
    }
    whole = ("name", "channels", "cnn_widths", "last_kernel", "initial_sigma", "conventions")
    return NetworkSettings.from_json(
        {name: s[name] for name in whole}
        | {"stride": s["gaussian_stride"], "colour": colour, "semantic": branch if semantic else None}
    )
