"""The transformer of a branch: a multi-view Swin Transformer with camera-aware attention.

In every block: windowed self-attention, then cross-attention to the other views. Layer shapes and names are those of MVSplat (UniMatch's transformer),
so that its weights load. The colour and the semantic branch use the same class. The paper's ablation replaces windows by full attention (`windows=1`).
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from itertools import pairwise, product

import torch
from jaxtyping import Float
from torch import Tensor, nn

from semgs.model.attention.camera_attention import TokenTransforms, token_transforms
from semgs.model.layers.network_input import NetworkInput


class WindowAttention(nn.Module):
    """Post-norm attention of one head in windows: norm(merge(attention(q, k, v))).

    Args:
        channels: d.
        expansion: hidden width of the feed-forward network over (source, message), as a multiple of 2d; 0 for none.
    """

    def __init__(self, channels: int, expansion: int = 0) -> None:
        super().__init__()
        self.q_proj = nn.Linear(channels, channels, bias=False)
        self.k_proj = nn.Linear(channels, channels, bias=False)
        self.v_proj = nn.Linear(channels, channels, bias=False)
        self.merge = nn.Linear(channels, channels, bias=False)
        self.norm1 = nn.LayerNorm(channels)
        self.mlp: nn.Sequential | None = None
        if expansion:
            hidden = 2 * channels * expansion
            self.mlp = nn.Sequential(
                nn.Linear(2 * channels, hidden, bias=False), nn.GELU(), nn.Linear(hidden, channels, bias=False)
            )
            self.norm2 = nn.LayerNorm(channels)

    def forward(
        self,
        source: Float[Tensor, "b v h w d"],
        target: Float[Tensor, "b v h w d"],
        windows: Windows,
        transforms: TokenTransforms | None,
        cross: bool,
    ) -> Float[Tensor, "b v h w d"]:
        """`source` plus its message from `target`: the same view's tokens, or those of all other views."""
        q, k, v = self.q_proj(source), self.k_proj(target), self.v_proj(target)
        if transforms is not None:
            q, k, v = transforms.queries(q), transforms.keys(k), transforms.keys(v)
        message = windows.attend(q, k, v, cross)
        if transforms is not None:
            message = transforms.outputs(message)
        message = self.norm1(self.merge(message))
        if self.mlp is not None:
            message = self.norm2(self.mlp(torch.cat((source, message), dim=-1)))
        known: Tensor = source + message
        return known


class Block(nn.Module):
    """One of the paper's Transformer blocks: self-attention, then cross-attention with a feed-forward network."""

    def __init__(self, channels: int, expansion: int) -> None:
        super().__init__()
        self.self_attn = WindowAttention(channels)
        self.cross_attn_ffn = WindowAttention(channels, expansion)

    def forward(
        self, tokens: Float[Tensor, "b v h w d"], windows: Windows, transforms: TokenTransforms | None
    ) -> Float[Tensor, "b v h w d"]:
        """All views at once: each attends to the other views as they were at the input of this block."""
        own = self.self_attn(tokens, tokens, windows, transforms, cross=False)
        known: Tensor = self.cross_attn_ffn(own, tokens, windows, transforms, cross=True)
        return known


class Windows:
    """A partition of a feature map into windows, or into windows shifted down and right by half a window and cut off at the borders.

    Swin rolls the map by half a window, uses the same windows again, and masks pairs of tokens from opposite borders by -100 in the
    logits. With 2x2 windows this gives nine regions (figure 4 there). Cutting the map into these regions gives every token the same keys,
    up to e^-100, and saves the masked products, which are 44 %.

    Args:
        grid: (height, width) of the map, multiples of `count`.
        count: windows along each side; 1 is full attention.
        shifted: shift the windows by half of their sides.

    Raises:
        ValueError: the map cannot be divided.
    """

    def __init__(self, grid: tuple[int, int], count: int, shifted: bool) -> None:
        if grid[0] % count or grid[1] % count:
            raise ValueError(f"a map of {grid} (height, width) cannot be divided into {count}x{count} windows")
        self.size = (grid[0] // count, grid[1] // count)
        self.rows, self.columns = (
            _bands(side, size, size // 2 if shifted and count > 1 else 0)
            for side, size in zip(grid, self.size, strict=True)
        )
        self._groups: dict[tuple[int, int], list[tuple[int, int]]] = {}
        for row, column in product(range(len(self.rows)), range(len(self.columns))):
            sides = tuple(band.stop - band.start for band in (self.rows[row], self.columns[column]))
            self._groups.setdefault(sides, []).append((row, column))

    def attend(
        self,
        q: Float[Tensor, "b v h w d"],
        k: Float[Tensor, "b v h w d"],
        v: Float[Tensor, "b v h w d"],
        cross: bool,
    ) -> Float[Tensor, "b v h w d"]:
        """Softmax(q k^T / sqrt(d)) v in each window; with `cross`, over the tokens of all other views in one softmax."""
        b, views = q.shape[:2]
        others = torch.tensor([[j for j in range(views) if j != i] for i in range(views)], device=q.device)
        done: dict[tuple[int, int], Tensor] = {}
        for sides, places in self._groups.items():
            own, keys, values = (self._split(x, places) for x in (q, k, v))
            if cross:
                keys, values = (x[:, others].transpose(2, 3).flatten(3, 4) for x in (keys, values))
            out = nn.functional.scaled_dot_product_attention(
                own.flatten(0, 1), keys.flatten(0, 1), values.flatten(0, 1)
            )
            out = torch.unflatten(out, 0, (b, views))
            done.update(zip(places, torch.unflatten(out, 3, sides).unbind(2), strict=True))
        rows = (
            torch.cat([done[row, column] for column in range(len(self.columns))], dim=3)
            for row in range(len(self.rows))
        )
        return torch.cat(list(rows), dim=2)

    def _split(
        self, x: Float[Tensor, "b v h w d"], places: Sequence[tuple[int, int]]
    ) -> Float[Tensor, "b v windows tokens d"]:
        """The tokens of windows of one size, row-major inside each."""
        return torch.stack([x[:, :, self.rows[r], self.columns[c]].flatten(2, 3) for r, c in places], dim=2)


def _bands(side: int, size: int, shift: int) -> tuple[slice, ...]:
    """A side cut every `size`, from `shift` on."""
    cuts = sorted({0, *range(shift, side + 1, size), side})
    return tuple(slice(start, stop) for start, stop in pairwise(cuts))


class MultiViewSwin(nn.Module):
    """Blocks over the tokens of all views, every other one with shifted windows.

    Args:
        channels: d.
        blocks: number of blocks.
        windows: along each side of the map; 1 is full attention.
        expansion: of the feed-forward networks (MVSplat: 4).
        reduction: with 2, blocks work at half of the features' size, between a strided convolution and bilinear upsampling with a
            residual connection (used by `small`; the paper has 1).
    """

    def __init__(self, channels: int, blocks: int, windows: int = 2, expansion: int = 4, reduction: int = 1) -> None:
        super().__init__()
        self.windows = windows
        self.reduction = reduction
        self.layers = nn.ModuleList(Block(channels, expansion) for _ in range(blocks))
        if reduction > 1:
            self.reduce = nn.Conv2d(channels, channels, reduction + 1, stride=reduction, padding=reduction // 2)
            self.expand = nn.Conv2d(channels, channels, 1)

    def grid(self, size: tuple[int, int]) -> tuple[int, int]:
        """The size of the token map, for features of a size."""
        return size[0] // self.reduction, size[1] // self.reduction

    def forward(
        self, features: Float[Tensor, "b v d h w"], transforms: TokenTransforms | None
    ) -> Float[Tensor, "b v d h w"]:
        """Features of the same size, with information from the other views."""
        b, v = features.shape[:2]
        x = features.flatten(0, 1)
        if self.reduction > 1:
            x = self.reduce(x)
        grid = (x.shape[-2], x.shape[-1])
        plain = Windows(grid, self.windows, False)
        shifted = Windows(grid, self.windows, True)
        x = x + sine_positions(plain.size, x.shape[1], x).repeat(1, self.windows, self.windows)
        tokens = torch.unflatten(x, 0, (b, v)).permute(0, 1, 3, 4, 2)
        for index, block in enumerate(self.layers):
            tokens = block(tokens, shifted if index % 2 else plain, transforms)
        x = tokens.permute(0, 1, 4, 2, 3)
        if self.reduction > 1:
            x = nn.functional.interpolate(
                self.expand(x.flatten(0, 1)), scale_factor=self.reduction, mode="bilinear", align_corners=False
            )
            x = features + torch.unflatten(x, 0, (b, v))
        return x


def sine_positions(size: tuple[int, int], channels: int, like: Tensor) -> Float[Tensor, "d h w"]:
    """DETR's sine encoding of the positions 1..n scaled to 2 pi, rows in the first half of the channels, then columns."""
    count = channels // 2
    exponents = 2 * (torch.arange(count, dtype=torch.float32, device=like.device) // 2) / count
    frequencies = 10000**-exponents
    codes = []
    for side in size:
        position = torch.arange(1, side + 1, dtype=torch.float32, device=like.device) / (side + 1e-6) * 2 * math.pi
        angles = position[:, None] * frequencies
        codes.append(torch.where(torch.arange(count, device=like.device) % 2 == 0, angles.sin(), angles.cos()))
    rows, columns = codes
    return torch.cat((rows.T[:, :, None].expand(-1, -1, size[1]), columns.T[:, None, :].expand(-1, size[0], -1))).to(
        like.dtype
    )


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
