"""The 2D U-Net of depth: residual blocks with group norm, and attention across all views at its coarsest level.

Layer shapes and names are those of MVSplat (the latent-diffusion U-Net without time), so that its weights load.
"""

from __future__ import annotations

from collections.abc import Sequence

from jaxtyping import Float
from torch import Tensor, nn

from semgs.model.layers.cnn import beside

GROUPS = 8


class ResBlock(nn.Module):
    """skip(x) + silu(norm(conv(silu(norm(conv(x)))))); the second norm starts at zero."""

    def __init__(self, inputs: int, outputs: int) -> None:
        super().__init__()
        self.in_layers = nn.Sequential(
            nn.Conv2d(inputs, outputs, 3, padding=1), nn.GroupNorm(GROUPS, outputs), nn.SiLU()
        )
        self.out_layers = nn.Sequential(nn.Conv2d(outputs, outputs, 3, padding=1), zero_norm(outputs), nn.SiLU())
        self.skip_connection = nn.Identity() if inputs == outputs else nn.Conv2d(inputs, outputs, 1)

    def forward(self, x: Float[Tensor, "n c h w"], views: int) -> Float[Tensor, "n d h w"]:
        """Features of the same size; only attention blocks use `views`."""
        changed: Tensor = self.skip_connection(x) + self.out_layers(self.in_layers(x))
        return changed


class CrossViewAttention(nn.Module):
    """x + norm(proj(attention)) over the tokens of all views of a scene, heads of at most 32 channels."""

    def __init__(self, channels: int) -> None:
        super().__init__()
        self.heads = max(channels // 32, 1)
        self.qkv = nn.Conv1d(channels, 3 * channels, 1)
        self.proj_out = nn.Conv1d(channels, channels, 1)
        self.norm = zero_norm(channels)

    def forward(self, x: Float[Tensor, "n c h w"], views: int) -> Float[Tensor, "n c h w"]:
        """Features of the same size; the first axis is (scene, view)."""
        n, c, h, w = x.shape
        joined = x.reshape(n // views, views, c, h * w).transpose(1, 2).flatten(2)
        parts = self.qkv(joined).unflatten(1, (self.heads, 3, c // self.heads)).transpose(-1, -2)
        # A token's channels must be adjacent in memory, or torch stores the weights of all pairs of tokens.
        q, k, v = parts.contiguous().unbind(2)
        out = nn.functional.scaled_dot_product_attention(q, k, v)
        out = self.proj_out(out.transpose(-1, -2).flatten(1, 2))
        message: Tensor = self.norm(out.unflatten(2, (views, h * w)).transpose(1, 2).reshape(n, c, h, w))
        return x + message


class Downsample(nn.Module):
    """Half the size by a strided convolution."""

    def __init__(self, channels: int) -> None:
        super().__init__()
        self.op = nn.Conv2d(channels, channels, 3, stride=2, padding=1)

    def forward(self, x: Float[Tensor, "n c h w"], views: int) -> Float[Tensor, "n c h2 w2"]:
        """Features of half the size."""
        halved: Tensor = self.op(x)
        return halved


class Upsample(nn.Module):
    """Twice the size by repetition, then a convolution."""

    def __init__(self, channels: int) -> None:
        super().__init__()
        self.conv = nn.Conv2d(channels, channels, 3, padding=1)

    def forward(self, x: Float[Tensor, "n c h w"], views: int) -> Float[Tensor, "n c h2 w2"]:
        """Features of twice the size."""
        doubled: Tensor = self.conv(nn.functional.interpolate(x, scale_factor=2, mode="nearest"))
        return doubled


class Stem(nn.Conv2d):
    """The first convolution, with the same signature as the other input blocks."""

    def forward(self, x: Float[Tensor, "n c h w"], views: int) -> Float[Tensor, "n c h w"]:  # type: ignore[override]
        """Features of the same size."""
        return super().forward(x)


class UNet(nn.Module):
    """A U-Net of one width.

    Args:
        channels: width of every level, a multiple of 8.
        levels: number of levels, each half the size of the previous one; the last has attention across views.
        decoder_blocks: residual blocks of each level on the way up (MVSplat: 2).
    """

    def __init__(self, channels: int, levels: int, decoder_blocks: int = 2) -> None:
        super().__init__()
        self.levels = levels
        self.decoder_blocks = decoder_blocks
        encoder: list[nn.ModuleList] = [nn.ModuleList([Stem(channels, channels, 3, padding=1)])]
        for level in range(levels):
            blocks: list[nn.Module] = [ResBlock(channels, channels)]
            if level == levels - 1:
                blocks.append(CrossViewAttention(channels))
            encoder.append(nn.ModuleList(blocks))
            if level < levels - 1:
                encoder.append(nn.ModuleList([Downsample(channels)]))
        self.input_blocks = nn.ModuleList(encoder)
        self.middle_block = nn.ModuleList([ResBlock(channels, channels), nn.Identity(), ResBlock(channels, channels)])
        decoder: list[nn.ModuleList] = []
        for level in reversed(range(levels)):
            for block in range(decoder_blocks):
                blocks = [ResBlock(2 * channels, channels)]
                if level == levels - 1:
                    blocks.append(CrossViewAttention(channels))
                if block == decoder_blocks - 1 and level > 0:
                    blocks.append(Upsample(channels))
                decoder.append(nn.ModuleList(blocks))
        self.output_blocks = nn.ModuleList(decoder)
        self.out = nn.Sequential(nn.Conv2d(channels, channels, 3, padding=1), nn.GroupNorm(GROUPS, channels), nn.SiLU())

    def forward(self, x: Float[Tensor, "n c h w"], views: int, seen: Sequence[Tensor] = ()) -> Float[Tensor, "n c h w"]:
        """Features of the same size.

        Args:
            x: [(scene, view) channels height width], both sides multiples of 2^(levels - 1).
            views: number of views per scene.
            seen: maps [n c hk wk] to add at the sizes below the first, from fine to coarse.
        """
        skips, more = [], iter(seen)
        for blocks in self.input_blocks:
            for block in blocks:  # type: ignore[attr-defined]
                x = block(x, views)
                if isinstance(block, Downsample):
                    added = next(more, None)
                    x = x if added is None else x + added
            skips.append(x)
        x = self.middle_block[2](self.middle_block[0](x, views), views)
        for index, blocks in enumerate(self.output_blocks):
            skip = skips.pop()
            if self.decoder_blocks == 1 and index > 0:
                skip = skips.pop()
            x = beside(x, skip)
            for block in blocks:  # type: ignore[attr-defined]
                x = block(x, views)
        features: Tensor = self.out(x)
        return features


def zero_norm(channels: int) -> nn.GroupNorm:
    """A group norm whose scale and shift start at zero, so that its branch starts without effect."""
    norm = nn.GroupNorm(GROUPS, channels)
    nn.init.zeros_(norm.weight)
    nn.init.zeros_(norm.bias)
    return norm
