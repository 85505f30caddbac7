"""The golden rule: weights that follow from the name of each parameter, so that fixtures need none stored."""

from __future__ import annotations

import math
import zlib

import numpy as np
import torch
from torch import Tensor, nn

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
"""Beginnings of tensor names in the golden data, which are older than the parts of the network, and today. The rest is the same."""


def golden_tensor(key: str, shape: tuple[int, ...]) -> Tensor:
    """The tensor of that name and shape: uniform numbers from splitmix64 of the name's crc32, scaled by role."""
    count = math.prod(shape)
    with np.errstate(over="ignore"):
        bits = np.uint64(zlib.crc32(key.encode()) << 32) + np.arange(count, dtype=np.uint64)
        bits = bits + np.uint64(0x9E3779B97F4A7C15)
        bits = (bits ^ (bits >> np.uint64(30))) * np.uint64(0xBF58476D1CE4E5B9)
        bits = (bits ^ (bits >> np.uint64(27))) * np.uint64(0x94D049BB133111EB)
        bits = bits ^ (bits >> np.uint64(31))
    uniform = (bits >> np.uint64(11)).astype(np.float64) * 2.0**-52 - 1
    if len(shape) == 1:
        values = 0.1 * math.sqrt(3) * uniform + (1 if key.endswith(("weight", "running_var")) else 0)
    else:
        values = math.sqrt(3 / math.prod(shape[1:])) * uniform
    if key.endswith("to_disparity.2.weight"):
        values = values * 0.05
    if key.endswith(("depth_head_lowres.2.weight", "cost_regressor.head.2.weight")):
        values = values * 3
    return torch.from_numpy(values.reshape(shape).astype(np.float32))


def golden_name(name: str) -> str:
    """The name that a tensor of the network has in the golden data."""
    for first, today in PREFIXES.items():
        if name.startswith(today):
            return first + name.removeprefix(today)
    return name


def fill_golden(model: nn.Module) -> nn.Module:
    """The network with golden weights by the names of the golden data: no norm is zero, no clamp saturates."""
    model.load_state_dict(
        {name: golden_tensor(golden_name(name), tuple(tensor.shape)) for name, tensor in model.state_dict().items()}
    )
    return model.eval()
