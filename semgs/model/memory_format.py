"""Layouts in memory: which of channels and pixels are next to each other, in kernels and in feature maps."""

from __future__ import annotations

import torch
from jaxtyping import Float
from torch import Tensor, nn


def lay_out(module: nn.Module, layout: torch.memory_format) -> None:
    """Bring the kernels of a module's convolutions into a layout, 3D ones into its like; the parameters stay the same objects."""
    volumes = torch.channels_last_3d if layout == torch.channels_last else layout
    for parameter in module.parameters():
        if parameter.ndim in (4, 5):
            parameter.data = parameter.data.contiguous(memory_format=layout if parameter.ndim == 4 else volumes)


def beside(*maps: Float[Tensor, "n _ h w"]) -> Float[Tensor, "n c h w"]:
    """Maps one after the other along the channels, in the layout of the widest of them.

    `torch.cat` of maps of several layouts takes four times as long as of one, and what it makes has to be turned for the next convolution.
    """
    widest = max(maps, key=lambda one: one.shape[1])
    last = widest.is_contiguous(memory_format=torch.channels_last)
    layout = torch.channels_last if last else torch.contiguous_format
    return torch.cat([one.contiguous(memory_format=layout) for one in maps], dim=1)
