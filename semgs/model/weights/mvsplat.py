"""MVSplat's checkpoints: read them, and map their tensors to ours."""

from __future__ import annotations

import re
from pathlib import Path
from pickle import UnpicklingError

import torch

from semgs.files.errors import InputError
from semgs.model.weights.weights_file import read_tensors

PREFIXES = {
    "backbone.backbone.": "cnn.",
    "backbone.transformer.": "colour.transformer.swin.",
    "depth_predictor.corr_refine_net.": "colour.depth.regressor.refine.",
    "depth_predictor.regressor_residual.": "colour.depth.regressor.residual.",
    "depth_predictor.depth_head_lowres.": "colour.depth.regressor.head.",
    "depth_predictor.upsampler.0.": "colour.heads.upsampler.conv.",
    "depth_predictor.proj_feature.": "colour.heads.refinement.project.",
    "depth_predictor.refine_unet.": "colour.heads.refinement.refine.",
    "depth_predictor.to_disparity.": "colour.heads.refinement.to_disparity.",
    "depth_predictor.to_gaussians.": "colour.heads.colour.",
}
"""Beginnings of MVSplat's names (without the leading "encoder.") and of ours; the rest is the same."""


def our_name(name: str) -> str | None:
    """Our name of one of MVSplat's tensors, None if there is none."""
    name = name.removeprefix("encoder.")
    for theirs, ours in PREFIXES.items():
        if name.startswith(theirs):
            return ours + name.removeprefix(theirs)
    return None


def read(path: Path) -> dict[str, torch.Tensor]:
    """The tensors of a checkpoint: safetensors, or Lightning's `.ckpt` read without unpickling objects.

    Raises:
        InputError: it is neither, or contains more than tensors and plain containers.
    """
    with path.open("rb") as file:
        zipped = file.read(2) == b"PK"
    if not zipped:
        return read_tensors(path)
    try:
        checkpoint = torch.load(path, map_location="cpu", weights_only=True)
    except UnpicklingError as error:
        found = re.search(r"(?:GLOBAL|global) (\S+)", str(error))
        raise InputError(
            path, "a checkpoint of tensors alone (torch.load with weights_only=True)",
            f"an object, {found[1]}" if found else "objects",
            advice="if you trust it, extract its tensors once: see docs/reproduce.md",
        ) from None  # fmt: skip
    except Exception as error:  # torch raises many kinds on a broken or hostile archive; some advise to unpickle it
        kind = "a TorchScript archive" if "TorchScript" in str(error) else f"a broken one ({type(error).__name__})"
        raise InputError(path, "a checkpoint that loads with weights_only=True", kind) from None
    state = checkpoint.get("state_dict") if isinstance(checkpoint, dict) else None
    if not isinstance(state, dict) or not all(isinstance(value, torch.Tensor) for value in state.values()):
        raise InputError(path, "a dictionary of tensors", "none", key="state_dict")
    return {name: tensor.float() for name, tensor in state.items()}


def renamed(tensors: dict[str, torch.Tensor], path: Path) -> dict[str, torch.Tensor]:
    """The same tensors under our names.

    Raises:
        InputError: one of them is not MVSplat's.
    """
    ours = {}
    for name, tensor in tensors.items():
        own = our_name(name)
        if own is None:
            raise InputError(path, "MVSplat's encoder alone", "another tensor", key=name)
        ours[own] = tensor
    return ours
