"""Memory formats: whether the channels or the pixels of kernels and feature maps are adjacent in memory."""

from __future__ import annotations

import torch
from jaxtyping import Float
from torch import Tensor, nn


def lay_out(module: nn.Module, layout: torch.memory_format) -> None:
    """Store the kernels of a module's convolutions, 3D ones too, in a memory format; parameters stay the same objects."""
    volumes = torch.channels_last_3d if layout == torch.channels_last else layout
    for parameter in module.parameters():
        if parameter.ndim in (4, 5):
            parameter.data = parameter.data.contiguous(memory_format=layout if parameter.ndim == 4 else volumes)


def beside(*maps: Float[Tensor, "n _ h w"]) -> Float[Tensor, "n c h w"]:
    """Maps concatenated along the channels, in the memory format of the widest.

    `torch.cat` of maps in different formats takes four times as long, and the next convolution has to convert the result.
    """
    widest = max(maps, key=lambda one: one.shape[1])
    last = widest.is_contiguous(memory_format=torch.channels_last)
    layout = torch.channels_last if last else torch.contiguous_format
    return torch.cat([one.contiguous(memory_format=layout) for one in maps], dim=1)
