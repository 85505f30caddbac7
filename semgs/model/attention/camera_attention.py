"""Camera-aware attention: what the paper calls camera pose injection (its equations 1 to 5), after PRoPE and GTA.

Each token t of view i carries the block-diagonal matrix G_t = blockdiag(I (x) P_i, RoPE(x_t), RoPE(y_t)): half of its
channels are multiplied by the view's projection, a quarter each is rotated by its column and its row. Queries become
G^T q, keys G^-1 k, values G^-1 v, so that logits depend on P_i P_j^-1 alone; the output is multiplied by G (PRoPE and
GTA; the paper's text leaves it out, `output_transform=False`), without which it would depend on the choice of world.
"""

from __future__ import annotations

from dataclasses import dataclass

import torch
from jaxtyping import Float
from torch import Tensor

from semgs.geometry.cameras import Cameras, inverse_rigid
from semgs.runtime.precision import outside_autocast

ROPE_BASE = 100.0
"""Base of the rotary frequencies, as PRoPE's."""

MINIMAL_BASELINE = 0.01
"""Smallest unit of translation, relative to the near bound, so that a camera that only rotates is valid input."""


@dataclass(frozen=True)
class TokenTransforms:
    """The factors of G for all tokens of a set of views.

    Attributes:
        projection: P of each view.
        inverse: P^-1 of each view.
        cosines: of the rotary angles, for each of the channels (column: first half, second half; row: likewise).
        sines: likewise, negative for the second halves.
        output: whether to multiply the attention output by G.
    """

    projection: Float[Tensor, "b v 4 4"]
    inverse: Float[Tensor, "b v 4 4"]
    cosines: Float[Tensor, "h w e"]
    sines: Float[Tensor, "h w e"]
    output: bool = True

    def queries(self, q: Float[Tensor, "b v h w d"]) -> Float[Tensor, "b v h w d"]:
        """G^T q."""
        return self._apply(q, self.projection, 1)

    def keys(self, k: Float[Tensor, "b v h w d"]) -> Float[Tensor, "b v h w d"]:
        """G^-1 k; the same for values."""
        return self._apply(k, self.inverse.mT, 1)

    def outputs(self, o: Float[Tensor, "b v h w d"]) -> Float[Tensor, "b v h w d"]:
        """G o, or o itself for the paper's text."""
        return self._apply(o, self.projection.mT, -1) if self.output else o

    @outside_autocast
    def _apply(self, x: Float[Tensor, "b v h w d"], right: Float[Tensor, "b v 4 4"], sign: int) -> Tensor:
        """Multiply groups of four channels, as row vectors, by `right` in the first half; rotate the others by -sign * angle.

        For rotations G^T = G^-1, so queries, keys and values are rotated by -angle and outputs by +angle. Computed in the dtype of G and
        returned in that of x.
        """
        b, v, h, w, d = x.shape
        tokens = x.to(right.dtype)
        projective = (tokens[..., : d // 2].reshape(b, v, -1, 4) @ right).reshape(b, v, h, w, d // 2)
        halves = torch.unflatten(tokens[..., d // 2 :], -1, (2, 2, d // 8))
        swapped = halves.flip(-2).flatten(-3)
        turned = torch.addcmul(tokens[..., d // 2 :] * self.cosines, swapped, self.sines, value=sign)
        return torch.cat((projective, turned), dim=-1).to(x.dtype)


def normalised_projections(
    cameras: Cameras, near: Float[Tensor, " b"]
) -> tuple[Float[Tensor, "b v 4 4"], Float[Tensor, "b v 4 4"]]:
    """P_i = [K_i R_i | K_i t_i; 0 1] (equation 1) of each view and its inverse, in float64.

    Poses are relative to the first camera. K is divided by width and height, with the image centre at 0. Translations are divided by
    the mean distance between camera centres (at least 1 % of the near bound). Both matrices are in closed form.

    Args:
        cameras: [b v].
        near: the near bound of each scene.
    """
    poses = cameras.world_from_camera
    first_from_camera = inverse_rigid(poses[:, :1]) @ poses
    camera_from_first = inverse_rigid(first_from_camera)
    centres = first_from_camera[..., :3, 3]
    pairs = torch.cdist(centres, centres)
    views = poses.shape[1]
    mean_distance = pairs.sum((-1, -2)) / max(views * (views - 1), 1)
    unit = torch.maximum(mean_distance, MINIMAL_BASELINE * near)[:, None, None]
    height, width = cameras.size
    k = cameras.intrinsics
    fx, fy = k[..., 0, 0] / width, k[..., 1, 1] / height
    cx, cy = k[..., 0, 2] / width - 0.5, k[..., 1, 2] / height - 0.5
    zero, one = torch.zeros_like(fx), torch.ones_like(fx)

    def matrix(*rows: Tensor) -> Tensor:
        return torch.unflatten(torch.stack(rows, dim=-1), -1, (4, 4))

    lift = matrix(fx, zero, cx, zero, zero, fy, cy, zero, zero, zero, one, zero, zero, zero, zero, one)
    drop = matrix(
        1 / fx, zero, -cx / fx, zero, zero, 1 / fy, -cy / fy, zero, zero, zero, one, zero, zero, zero, zero, one
    )
    there, back = camera_from_first.clone(), first_from_camera.clone()
    there[..., :3, 3] /= unit
    back[..., :3, 3] /= unit
    return lift @ there, back @ drop


def token_transforms(
    cameras: Cameras,
    near: Float[Tensor, " b"],
    grid: tuple[int, int],
    channels: int,
    like: Tensor,
    output_transform: bool = True,
) -> TokenTransforms:
    """G of every token of a feature map.

    Args:
        cameras: of the context views [b v].
        near: the near bound of each scene.
        grid: (height, width) of the feature map; positions are its integer columns and rows.
        channels: d, a multiple of 8.
        like: a tensor on the device and in the dtype of the features; half precisions get float32.
        output_transform: multiply the attention output by G.

    Raises:
        ValueError: `channels` is not a multiple of 8.
    """
    if channels % 8:
        raise ValueError(f"camera-aware attention has {channels} channels; expected a multiple of 8")
    projection, inverse = normalised_projections(cameras, near)
    dtype = torch.float64 if like.dtype == torch.float64 else torch.float32
    count = channels // 8
    frequencies = ROPE_BASE ** (-torch.arange(count, dtype=torch.float64) / count)
    rows, columns = (torch.arange(side, dtype=torch.float64) for side in grid)
    by_column = (columns[:, None] * frequencies).expand(grid[0], -1, -1)
    by_row = (rows[:, None] * frequencies)[:, None].expand(-1, grid[1], -1)
    angles = torch.cat((by_column, by_column, by_row, by_row), dim=-1)
    signs = torch.tensor([1.0, -1.0, 1.0, -1.0], dtype=torch.float64).repeat_interleave(count)
    return TokenTransforms(
        projection.to(like.device, dtype),
        inverse.to(like.device, dtype),
        angles.cos().to(like.device, dtype),
        (signs * angles.sin()).to(like.device, dtype),
        output_transform,
    )
