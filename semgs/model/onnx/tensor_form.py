"""The network as a function from tensors to tensors, in float32 and with operations that ONNX has.

The code of the network stays as it is. While the function runs, calls of the few operations that ONNX lacks go to others that give the same up to
rounding, and whatever would be float64 is float32.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from typing import Any

import torch
from jaxtyping import Float
from torch import Tensor, nn
from torch.overrides import TorchFunctionMode
from torch.utils._pytree import tree_map

from semgs.data.views import Views
from semgs.geometry.cameras import Cameras
from semgs.model.layers.network_input import WHOLE
from semgs.model.semgs import SemGS
from semgs.scene.encoding import Encoding

INPUTS = ("images", "world_from_camera", "intrinsics", "depth_range")
"""Names of the inputs of a `TensorForm`."""

LARGEST_PRODUCT = 2**25
"""Numbers in a product of texels: 134 MB. With more, it is computed in parts."""

Arguments = tuple[Tensor, Tensor, Tensor, Tensor]
"""The inputs."""


class TensorForm(nn.Module):
    """From images and cameras of one scene to the arrays of its Gaussians, and depth. The arrays have the names of scene.safetensors.

    Args:
        network: in evaluation mode, with a `precision` of float32.
    """

    def __init__(self, network: SemGS) -> None:
        super().__init__()
        self.network = network

    def forward(
        self,
        images: Float[Tensor, "v 3 h w"],
        world_from_camera: Float[Tensor, "v 4 4"],
        intrinsics: Float[Tensor, "v 3 3"],
        depth_range: Float[Tensor, "v 2"],
    ) -> dict[str, Tensor]:
        """The arrays by name.

        Args:
            images: of a size that needs no padding, 0..1.
            world_from_camera: rigid poses, camera to world [m].
            intrinsics: [px].
            depth_range: near and far of each view [m].
        """
        with StandardOperations():
            cameras = Cameras.trusted(world_from_camera, intrinsics, (images.shape[-2], images.shape[-1]))
            views = Views.trusted(images=images, cameras=cameras, depth_range=depth_range)
            encoding: Encoding = self.network(views, WHOLE)
            maps = {name: getattr(encoding, name) for name in ("depths", "confidences", "depth_spread")}
            return replace(encoding.gaussians, footprints=None).tensors() | maps


def arguments(views: Views) -> Arguments:
    """Views of one scene as inputs of a `TensorForm`."""
    cameras = views.cameras
    return views.images, cameras.world_from_camera.float(), cameras.intrinsics.float(), views.depth_range.float()


class StandardOperations(TorchFunctionMode):
    """While this is active, torch computes in float32 instead of float64, and calls of `replacements` go to other functions."""

    def __init__(self) -> None:
        super().__init__()
        self.replacements = replacements()

    def __torch_function__(self, func: Any, types: Any, args: Any = (), kwargs: Any = None) -> Any:
        """The result of one call."""
        args, kwargs = tree_map(_single, (args, kwargs or {}))
        replacement = self.replacements.get(func)
        if replacement is None:
            return func(*args, **kwargs)
        with self:  # it may call others
            return replacement(*args, **kwargs)


def replacements() -> dict[Any, Callable[..., Any]]:
    """The operations of the network that ONNX lacks, with functions that give the same."""
    from semgs.model.sweep import correlation  # noqa: F401  (it registers the operation)

    return {
        torch.linalg.inv: inverse_intrinsics,
        torch.cdist: distances,
        torch.ops.semgs.correlate.default: correlate_all_texels,
    }


def inverse_intrinsics(intrinsics: Float[Tensor, "*batch 3 3"]) -> Float[Tensor, "*batch 3 3"]:
    """The inverse of [[fx, s, cx], [0, fy, cy], [0, 0, 1]] in closed form."""
    k = intrinsics
    fx, skew, cx, fy, cy = k[..., 0, 0], k[..., 0, 1], k[..., 0, 2], k[..., 1, 1], k[..., 1, 2]
    zero, one = torch.zeros_like(fx), torch.ones_like(fx)
    first_row = (1 / fx, -skew / (fx * fy), (skew * cy / fy - cx) / fx)
    rows = torch.stack((*first_row, zero, 1 / fy, -cy / fy, zero, zero, one), dim=-1)
    return torch.unflatten(rows, -1, (3, 3))


def distances(a: Float[Tensor, "*batch n 3"], b: Float[Tensor, "*batch m 3"], **_: Any) -> Float[Tensor, "*batch n m"]:
    """Euclidean distances of all pairs of points, as `torch.cdist`."""
    return (a[..., :, None, :] - b[..., None, :, :]).square().sum(-1).sqrt()


def correlate_all_texels(
    reference: Float[Tensor, "n h w c"],
    source: Float[Tensor, "n h w c"],
    matrices: Float[Tensor, "n 3 3"],
    offsets: Float[Tensor, "n 3"],
    depths: Float[Tensor, "n l"],
    smallest: Float[Tensor, " n"],
    mask_unseen: bool,
) -> tuple[Float[Tensor, "n l h w"], Float[Tensor, "n l h w"]]:
    """The plane sweep's compiled operation; `semgs.model.sweep.cost_volume.correlate` is the specification of both.

    The product with a bilinear sample is the bilinear sample of the products. So all texels are multiplied with all others, and the products are
    sampled: with ONNX Runtime that takes a fraction of the time of `grid_sample`, which samples every channel.
    """
    n, h, w, _ = reference.shape
    rows, columns = torch.meshgrid(torch.arange(h).to(depths), torch.arange(w).to(depths), indexing="ij")
    texels = torch.stack((columns, rows, torch.ones_like(rows)), dim=-1).flatten(0, 1)
    points = (texels @ matrices.mT)[:, :, None] * depths[:, None, :, None] + offsets[:, None, None]
    limit = smallest[:, None, None]
    z = points[..., 2]
    u, v = (points[..., axis] / torch.maximum(z, limit) for axis in (0, 1))
    seen = ((z > limit) & (u >= -0.5) & (u <= w - 0.5) & (v >= -0.5) & (v <= h - 0.5)).to(depths.dtype)
    x, y = (u.clamp(0, w - 1), v.clamp(0, h - 1)) if mask_unseen else (u.clamp(-1, w), v.clamp(-1, h))
    taps = [_tap(x, y, right, below, (h, w)) for right in (0, 1) for below in (0, 1)]
    step = max(LARGEST_PRODUCT // (h * w), 1)
    parts = []
    for pair in range(n):
        own, other = reference[pair].flatten(0, 1), source[pair].flatten(0, 1).mT
        for start in range(0, h * w, step):
            at = slice(start, min(start + step, h * w))
            products = own[at] @ other
            sampled = [products.gather(1, place[pair, at]) * weight[pair, at] for place, weight in taps]
            parts.append(torch.stack(sampled).sum(0))
    sums = torch.cat(parts).reshape(n, h * w, -1)
    sums = sums * seen if mask_unseen else sums
    return torch.unflatten(sums.mT, 2, (h, w)), torch.unflatten(seen.mT, 2, (h, w))


def _tap(x: Tensor, y: Tensor, right: int, below: int, size: tuple[int, int]) -> tuple[Tensor, Tensor]:
    """The number of one of the four texels around positions, row by row, and its bilinear weight, 0 outside the map."""
    (h, w), left, top = size, x.floor(), y.floor()
    column, row = left + right, top + below
    weight = (x - left if right else 1 - (x - left)) * (y - top if below else 1 - (y - top))
    inside = (column >= 0) & (column < w) & (row >= 0) & (row < h)
    place = row.clamp(0, h - 1) * w + column.clamp(0, w - 1)
    return place.long(), weight * inside


def _single(value: Any) -> Any:
    """The value in float32 if it is a float64 tensor, and float32 for float64 itself."""
    if value is torch.float64:
        return torch.float32
    return value.float() if isinstance(value, Tensor) and value.dtype == torch.float64 else value
