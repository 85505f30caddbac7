"""MVSplat's names: which of its tensors is which of ours, and the half-turn between its harmonics and the standard ones."""

from __future__ import annotations

PREFIXES = {
    "backbone.backbone.": "cnn.",
    "backbone.transformer.": "colour_transformer.",
    "depth_predictor.corr_refine_net.": "cost_regressor.refine.",
    "depth_predictor.regressor_residual.": "cost_regressor.residual.",
    "depth_predictor.depth_head_lowres.": "cost_regressor.head.",
    "depth_predictor.upsampler.0.": "colour_upsampler.conv.",
    "depth_predictor.proj_feature.": "depth_refinement.project.",
    "depth_predictor.refine_unet.": "depth_refinement.refine.",
    "depth_predictor.to_disparity.": "depth_refinement.to_disparity.",
    "depth_predictor.to_gaussians.": "colour_head.",
}
"""Beginning of MVSplat's names (without the leading "encoder.") and of ours; what follows is equal."""


def our_name(name: str) -> str | None:
    """Our name of one of MVSplat's tensors, None if it has none here."""
    name = name.removeprefix("encoder.")
    for theirs, ours in PREFIXES.items():
        if name.startswith(theirs):
            return ours + name.removeprefix(theirs)
    return None
