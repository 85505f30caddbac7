"""Format 1 of weights files, which versions before the network was composed of parts wrote: flat settings, and other names of tensors.

Such files keep loading; they are never written.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from torch import Tensor

from semgs.model.conventions import Conventions
from semgs.model.settings import (
    ColourSettings,
    DepthSettings,
    MVSplatHeads,
    NetworkSettings,
    PaperHeads,
    Pyramid,
    SemanticSettings,
    TransformerSettings,
    TwoBlocks,
    made,
)

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
"""Beginning of a tensor's name in format 1 and today; what follows is equal, and so are names that begin with none of these."""


def todays_name(name: str) -> str:
    """The name today of a tensor of format 1."""
    for first, today in PREFIXES.items():
        if name.startswith(first):
            return today + name.removeprefix(first)
    return name


def todays_tensors(tensors: Mapping[str, Tensor]) -> dict[str, Tensor]:
    """Tensors of format 1 under their names today."""
    return {todays_name(name): tensor for name, tensor in tensors.items()}


def todays_settings(flat: Mapping[str, Any], semantic: bool = True) -> NetworkSettings:
    """The settings of a file of format 1.

    Args:
        flat: as its header has them.
        semantic: whether the file has a class table, and so a semantic branch.

    Raises:
        KeyError, TypeError, ValueError: these are no such settings.
    """
    s = {
        "paper_heads": False,
        "opacity_hidden": 32,
        "semantic_pyramid": (),
        **flat,
    }  # the oldest files have none of these
    for flag in ("paper_heads", "shared_layers"):
        if not isinstance(s[flag], bool):
            raise ValueError(f"{flag} is {s[flag]!r:.60}; expected bool")
    pyramid = tuple(s["semantic_pyramid"])

    def transformer(branch: str) -> TransformerSettings:
        return made(
            TransformerSettings,
            blocks=s[f"{branch}_blocks"],
            windows=s["windows"],
            expansion=s["expansion"],
            reduction=s["reduction"],
            camera_aware=s[f"camera_aware_{branch}"],
            output_transform=s["output_transform"],
        )

    depth = made(
        DepthSettings,
        candidates=s["candidates"],
        width=s["cost_width"],
        hidden=s["cost_hidden"],
        levels=s["cost_levels"],
        decoder_blocks=s["decoder_blocks"],
        cosine_cost=s["cosine_cost"],
        cost_prior=s["cost_prior"],
        initial_scale=s["initial_depth_scale"],
    )
    mvsplat = made(
        MVSplatHeads,
        upsampled=s["upsampled_channels"],
        projected=s["projected_channels"],
        width=s["refine_width"],
        levels=s["refine_levels"],
        decoder_blocks=s["decoder_blocks"],
    )
    return made(
        NetworkSettings,
        name=s["name"],
        channels=s["channels"],
        cnn_widths=tuple(s["cnn_widths"]),
        stride=s["gaussian_stride"],
        last_kernel=s["last_kernel"],
        initial_sigma=s["initial_sigma"],
        colour=made(
            ColourSettings,
            transformer=transformer("colour"),
            depth=depth,
            heads=made(PaperHeads, opacity_hidden=s["opacity_hidden"]) if s["paper_heads"] else mvsplat,
            hidden=s["colour_hidden"],
            harmonics=s["harmonics"],
            from_image=s["colour_from_image"],
            shrink_seen=0.5 if s["name"] == "small" else 0.0,  # format 1 is older than the rule
        ),
        semantic=made(
            SemanticSettings,
            transformer=transformer("semantic"),
            refinement=made(Pyramid, widths=pyramid) if pyramid else TwoBlocks(),
            own_cnn=not s["shared_layers"],
            hidden=s["semantic_hidden"],
        ) if semantic else None,
        conventions=made(Conventions, **s["conventions"]),
    )  # fmt: skip
