"""Splatting on CPU: Numba kernels as differentiable torch operators; equals `reference` in value and gradient.

Annotations are evaluated here, since torch reads the operators' schemas from them.
"""

from dataclasses import dataclass

import numpy as np
import torch
from jaxtyping import Float, Float64, Int64
from torch import Tensor

from semgs.geometry.compiled import numba_threads
from semgs.rendering.pinhole import Pinhole, near_plane
from semgs.rendering.projection_kernels import project, project_backward
from semgs.rendering.splats import Layer, Splats
from semgs.rendering.tile_kernels import (
    PARTS,
    TILE_HEIGHT,
    TILE_WIDTH,
    count_pairs,
    draw,
    draw_backward,
    fill_pairs,
    sort_pairs,
)


def depth_order(means: Float[Tensor, "g 3"], camera: Pinhole, near: float | None) -> Int64[Tensor, " drawn"]:
    """The Gaussians that are drawn, nearest first; equal depths keep the order of their index."""
    with torch.no_grad():
        depths = (means.detach().double() - camera.centre) @ camera.axes[2]
        drawn = (depths > near_plane(depths, near)).nonzero()[:, 0]
        return drawn[_stable_order(depths[drawn])]


def splat(splats: Splats, order: Int64[Tensor, " drawn"], camera: Pinhole) -> Layer:
    """Features blended at every pixel, and the light that is left there (float64)."""
    tensors = (splats.means, splats.quaternions, splats.scales, splats.opacities, splats.features)
    picture, transmittance, _ = _splat(
        *(one.contiguous() for one in tensors), order, camera_vector(camera), *camera.size
    )
    return Layer(picture, transmittance)


def pair_count(splats: Splats, order: Int64[Tensor, " drawn"], camera: Pinhole) -> int:
    """How many pairs of Gaussian and tile `splat` draws: what its time and memory follow."""
    geometry = (splats.means, splats.quaternions, splats.scales, splats.opacities)
    return len(into_tiles(*geometry, order, camera_vector(camera), *camera.size).pairs)


def camera_vector(camera: Pinhole) -> Float64[Tensor, " 20"]:
    """A camera in the layout of `projection_kernels`."""
    numbers = (*camera.focal_px, *camera.principal_px, *(bound for limits in camera.slope_limits for bound in limits))
    return torch.cat((camera.axes.flatten(), camera.centre, torch.tensor(numbers, dtype=torch.float64)))


def _stable_order(depths: Float[Tensor, " n"]) -> Int64[Tensor, " n"]:
    """argsort of positive numbers, equal ones in the order of their index; some ten times faster than a stable argsort.

    One sort of integers whose high bits are the leading bits of the number and whose low bits are its index. Where two
    numbers agree in all the bits that found room and yet differ, the stable argsort decides.
    """
    values = depths.numpy()
    index_bits = np.uint64(max(1, len(values) - 1).bit_length())
    bits = values.view(np.uint64)
    spread = int(bits.max() - bits.min()).bit_length() if len(bits) else 0
    shift = np.uint64(max(0, spread + int(index_bits) - 64))
    keys = ((bits - bits.min(initial=np.uint64(2**63))) >> shift) << index_bits | np.arange(len(bits), dtype=np.uint64)
    keys.sort()
    order = torch.from_numpy((keys & ((np.uint64(1) << index_bits) - np.uint64(1))).astype(np.int64))
    if shift and bool((depths[order].diff() < 0).any()):
        return torch.argsort(depths, stable=True)
    return order


@torch.library.custom_op("semgs::splat", mutates_args=(), device_types="cpu")
def _splat(
    means: Tensor, quaternions: Tensor, scales: Tensor, opacities: Tensor, features: Tensor, order: Tensor,
    camera: Tensor, height: int, width: int,
) -> tuple[Tensor, Tensor, Tensor]:  # fmt: skip
    picture = features.new_empty(features.shape[1], height, width)
    transmittance = torch.empty(height, width, dtype=torch.float64)
    last = torch.empty(height, width, dtype=torch.int32)
    with numba_threads():
        tiles = into_tiles(means, quaternions, scales, opacities, order, camera, height, width)
        draw(
            tiles.ellipses, _array(features), tiles.first_in_tile, tiles.gaussians,
            picture.numpy(), transmittance.numpy(), last.numpy(),
        )  # fmt: skip
    return picture, transmittance, last


@_splat.register_fake
def _(means, quaternions, scales, opacities, features, order, camera, height, width):
    return (
        features.new_empty(features.shape[1], height, width),
        features.new_empty(height, width, dtype=torch.float64),
        features.new_empty(height, width, dtype=torch.int32),
    )


@torch.library.custom_op("semgs::splat_backward", mutates_args=(), device_types="cpu")
def _splat_backward(
    means: Tensor, quaternions: Tensor, scales: Tensor, opacities: Tensor, features: Tensor, order: Tensor,
    camera: Tensor, transmittance: Tensor, last: Tensor, grad_picture: Tensor, grad_transmittance: Tensor,
) -> tuple[Tensor, Tensor, Tensor, Tensor, Tensor]:  # fmt: skip
    height, width = transmittance.shape
    grad_means, grad_quaternions = means.new_zeros(means.shape), quaternions.new_zeros(quaternions.shape)
    grad_scales, grad_opacities = scales.new_zeros(scales.shape), opacities.new_zeros(opacities.shape)
    grad_features = features.new_zeros(features.shape)
    with numba_threads():
        tiles = into_tiles(means, quaternions, scales, opacities, order, camera, height, width)
        geometry = np.zeros((len(tiles.pairs), 6))
        blended = np.zeros((len(tiles.pairs), features.shape[1]), _array(features).dtype)
        draw_backward(
            tiles.ellipses, _array(features), tiles.first_in_tile, tiles.gaussians, tiles.pairs,
            transmittance.numpy(), last.numpy(), _array(grad_picture), _array(grad_transmittance), geometry, blended,
        )  # fmt: skip
        project_backward(
            _array(means), _array(quaternions), _array(scales), camera.numpy(), tiles.ellipses, tiles.first_pair,
            geometry, blended, grad_means.numpy(), grad_quaternions.numpy(), grad_scales.numpy(), grad_opacities.numpy(),
            grad_features.numpy(),
        )  # fmt: skip
    return grad_means, grad_quaternions, grad_scales, grad_opacities, grad_features


@_splat_backward.register_fake
def _(
    means, quaternions, scales, opacities, features, order, camera, transmittance, last, grad_picture,
    grad_transmittance,
):  # fmt: skip
    return tuple(torch.empty_like(one) for one in (means, quaternions, scales, opacities, features))


def _save(ctx, inputs, output) -> None:
    *tensors, _, _ = inputs
    _, transmittance, last = output
    ctx.save_for_backward(*tensors, transmittance, last)
    ctx.mark_non_differentiable(last)


def _differentiate(ctx, grad_picture, grad_transmittance, _):
    *tensors, transmittance, last = ctx.saved_tensors
    gradients = _splat_backward(
        *tensors, transmittance, last, grad_picture.contiguous(), grad_transmittance.contiguous()
    )
    return *gradients, None, None, None, None


_splat.register_autograd(_differentiate, setup_context=_save)


@dataclass(frozen=True)
class Tiles:
    """Projected Gaussians and which tiles they meet.

    Recomputed by the backward pass: that takes less time than its share of memory would be worth.
    """

    ellipses: np.ndarray  # [g 8]
    first_in_tile: np.ndarray  # [tiles + 1]
    gaussians: np.ndarray  # [pairs], tile by tile, front to back
    pairs: np.ndarray  # [pairs], the number of each pair, Gaussian by Gaussian
    first_pair: np.ndarray  # [g + 1]


def into_tiles(
    means: Tensor, quaternions: Tensor, scales: Tensor, opacities: Tensor, order: Tensor, camera: Tensor,
    height: int, width: int,
) -> Tiles:  # fmt: skip
    """Project Gaussians and sort them into tiles, front to back."""
    count = len(means)
    ellipses = np.empty((count, 8))
    project(_array(means), _array(quaternions), _array(scales), _array(opacities), camera.numpy(), ellipses)
    ranks = np.full(count, -1, np.int32)
    ranks[order.numpy()] = np.arange(len(order), dtype=np.int32)

    tiles = -(-height // TILE_HEIGHT) * -(-width // TILE_WIDTH)
    counts = np.zeros((PARTS, tiles), np.int64)
    first_pair = np.zeros(count + 1, np.int64)
    rectangles = np.empty((count, 4), np.int32)
    count_pairs(ellipses, ranks, height, width, rectangles, first_pair[1:], counts)
    np.cumsum(first_pair, out=first_pair)
    ends = np.cumsum(counts.T).reshape(tiles, PARTS)
    first_in_tile = np.concatenate(([0], ends[:, -1]))
    pairs = np.empty(first_pair[-1], np.int64)
    fill_pairs(ellipses, ranks, width, rectangles, first_pair, np.ascontiguousarray(ends.T) - counts, pairs)
    gaussians = np.empty(len(pairs), np.int32)
    sort_pairs(first_in_tile, order.numpy(), pairs, gaussians)
    return Tiles(ellipses, first_in_tile, gaussians, pairs, first_pair)


def _array(tensor: Tensor) -> np.ndarray:
    return tensor.detach().contiguous().numpy()
