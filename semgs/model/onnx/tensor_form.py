"""The network as a function from tensors to tensors, in float32 and with operations that ONNX has.

The code of the network stays as it is. While the function runs, calls of the few operations that ONNX lacks go to others that give the same up to
rounding, and whatever would be float64 is float32.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import torch
from jaxtyping import Float
from torch import Tensor, nn
from torch.overrides import TorchFunctionMode
from torch.utils._pytree import tree_map

from semgs.data.views import Views
from semgs.geometry.cameras import Cameras
from semgs.model.layers.chunks import WHOLE
from semgs.model.semgs import SemGS
from semgs.model.sweep.cost_volume import correlate

INPUTS = ("images", "world_from_camera", "intrinsics", "depth_range")
"""Names of the inputs of a `TensorForm`."""

Arguments = tuple[Tensor, Tensor, Tensor, Tensor]
"""The inputs."""


class TensorForm(nn.Module):
    """From images and cameras of one scene to the arrays of its Gaussians, and depth. The arrays have the names of scene.safetensors.

    Args:
        network: in evaluation mode.
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
            encoding = self.network(views, WHOLE)
            maps = {name: getattr(encoding, name) for name in ("depths", "confidences", "depth_spread")}
            return encoding.gaussians.tensors() | maps


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
    """The operations of the network that ONNX or TensorRT lacks, with functions that give the same."""
    from semgs.model.sweep import correlation  # noqa: F401  (it registers the operation)

    return {
        torch.linalg.inv: inverse_intrinsics,
        torch.cdist: distances,
        torch.split: split,
        torch.ops.semgs.correlate.default: correlate_channels_last,
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


def split(tensor: Tensor, size: int, dim: int = 0) -> tuple[Tensor, ...]:
    """Parts of `size` along an axis, as `torch.split`, which becomes a sequence in ONNX; TensorRT has none."""
    count = tensor.shape[dim]
    return tuple(tensor.narrow(dim, start, min(size, count - start)) for start in range(0, count, size))


def correlate_channels_last(reference: Tensor, source: Tensor, *others: Any) -> tuple[Tensor, Tensor]:
    """The plane sweep's compiled operation, as the plain function that specifies it."""
    return correlate(reference.permute(0, 3, 1, 2), source.permute(0, 3, 1, 2), *others)


def _single(value: Any) -> Any:
    """The value in float32 if it is a float64 tensor, and float32 for float64 itself."""
    if value is torch.float64:
        return torch.float32
    return value.float() if isinstance(value, Tensor) and value.dtype == torch.float64 else value
