"""The transformer of a branch, with its camera-aware attention."""

from __future__ import annotations

import torch
from jaxtyping import Float
from torch import Tensor, nn

from semgs.model.attention.camera_attention import token_transforms
from semgs.model.attention.swin import MultiViewSwin
from semgs.model.layers.network_input import NetworkInput


class CameraTransformer(nn.Module):
    """Adds information from the other views to each view's features.

    Args:
        swin: the blocks.
        camera_aware: camera-aware attention; else the transformer ignores cameras (ablation *C-Inj*).
        output_transform: multiply the attention output by G; False is the paper's text.
    """

    def __init__(self, swin: MultiViewSwin, camera_aware: bool, output_transform: bool) -> None:
        super().__init__()
        self.swin = swin
        self.camera_aware = camera_aware
        self.output_transform = output_transform

    def forward(self, features: Float[Tensor, "n c h w"], inputs: NetworkInput) -> Float[Tensor, "n c h w"]:
        """Features of the same size."""
        transforms = None
        if self.camera_aware:
            grid = self.swin.grid((features.shape[-2], features.shape[-1]))
            transforms = token_transforms(
                inputs.cameras, inputs.near, grid, features.shape[1], features, self.output_transform
            )
        batch = inputs.cameras.batch
        transformed: Tensor = self.swin(torch.unflatten(features, 0, batch), transforms)
        return transformed.flatten(0, 1)
