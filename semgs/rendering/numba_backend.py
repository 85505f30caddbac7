"""Splatting on the CPU: Numba kernels as differentiable torch operations, equal to `reference` in value and gradient.

This module evaluates its annotations, because torch reads the schemas of the operations from them.
"""

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
import torch
from jaxtyping import Float, Float64, Int64
from torch import Tensor

from semgs.rendering.projection_kernels import project, project_backward
from semgs.rendering.splats import Layer, Pinhole, Splats, near_plane
from semgs.rendering.tile_kernels import (
    SHARES,
    TILE_HEIGHT,
    TILE_WIDTH,
    add_pairs,
    count_pairs,
    draw,
    draw_backward,
    fill_pairs,
    sort_pairs,
)
from semgs.runtime.kernels import in_threads, operation

PAIRS_AT_A_TIME = 1 << 21
"""Pairs of Gaussian and tile that are in memory at a time, those of a run of tiles; 12 bytes each, about 140 in the backward pass. A
single tile may have more, up to the number of Gaussians."""


def depth_order(means: Float[Tensor, "g 3"], camera: Pinhole, near: float | None) -> Int64[Tensor, " drawn"]:
    """The Gaussians to render, nearest first; those of equal depth stay in the order of their index."""
    with torch.no_grad():
        depths = (means.detach().double() - camera.centre) @ camera.axes[2]
        drawn = (depths > near_plane(depths, near)).nonzero()[:, 0]
        return drawn[_stable_order(depths[drawn])]


def splat(splats: Splats, order: Int64[Tensor, " drawn"], camera: Pinhole) -> Layer:
    """The features blended at every pixel, and the transmittance that is left there (float64)."""
    tensors = (splats.means, splats.quaternions, splats.scales, splats.opacities, splats.features)
    picture, transmittance, _ = _splat(
        *(one.contiguous() for one in tensors), order, camera_vector(camera), *camera.size
    )
    return Layer(picture, transmittance)


def camera_vector(camera: Pinhole) -> Float64[Tensor, " 20"]:
    """A camera in the layout of `projection_kernels`."""
    numbers = (*camera.focal_px, *camera.principal_px, *(bound for limits in camera.slope_limits for bound in limits))
    return torch.cat((camera.axes.flatten(), camera.centre, torch.tensor(numbers, dtype=torch.float64)))


def _stable_order(depths: Float[Tensor, " n"]) -> Int64[Tensor, " n"]:
    """Stable argsort of positive numbers, about ten times faster than torch's.

    It sorts integers whose high bits are the leading bits of the number and whose low bits are its index. If two different numbers
    agree in all leading bits that fit, it falls back to torch's stable argsort.
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


@operation
def _splat(
    means: Tensor, quaternions: Tensor, scales: Tensor, opacities: Tensor, features: Tensor, order: Tensor,
    camera: Tensor, height: int, width: int,
) -> tuple[Tensor, Tensor, Tensor]:  # fmt: skip
    picture = features.new_empty(features.shape[1], height, width)
    transmittance = torch.empty(height, width, dtype=torch.float64)
    last = torch.empty(height, width, dtype=torch.int32)
    projected = Projected.of(means, quaternions, scales, opacities, order, camera, height, width)
    for count in projected.runs():
        tiles = projected.tiles(count)
        in_threads(
            draw, projected.ellipses, _array(features), tiles.first, tiles.first_in_tile, tiles.gaussians,
            picture.numpy(), transmittance.numpy(), last.numpy(),
        )  # fmt: skip
        del tiles  # before the next run's are made
    return picture, transmittance, last


@torch.library.register_fake(_splat)
def _(means, quaternions, scales, opacities, features, order, camera, height, width):
    return (
        features.new_empty(features.shape[1], height, width),
        features.new_empty(height, width, dtype=torch.float64),
        features.new_empty(height, width, dtype=torch.int32),
    )


@operation
def _splat_backward(
    means: Tensor, quaternions: Tensor, scales: Tensor, opacities: Tensor, features: Tensor, order: Tensor,
    camera: Tensor, transmittance: Tensor, last: Tensor, grad_picture: Tensor, grad_transmittance: Tensor,
) -> tuple[Tensor, Tensor, Tensor, Tensor, Tensor]:  # fmt: skip
    height, width = transmittance.shape
    grad_means, grad_quaternions = means.new_zeros(means.shape), quaternions.new_zeros(quaternions.shape)
    grad_scales, grad_opacities = scales.new_zeros(scales.shape), opacities.new_zeros(opacities.shape)
    grad_features = features.new_zeros(features.shape)
    projected = Projected.of(means, quaternions, scales, opacities, order, camera, height, width)
    met = np.zeros(len(means), np.bool_)
    grad_ellipses = np.zeros((len(means), 6))
    for count in projected.runs():
        tiles = projected.tiles(count)
        geometry = np.zeros((count.pairs, 6))
        blended = np.zeros((count.pairs, features.shape[1]), _array(features).dtype)
        in_threads(
            draw_backward, projected.ellipses, _array(features), tiles.first, tiles.first_in_tile, tiles.gaussians, tiles.pairs,
            transmittance.numpy(), last.numpy(), _array(grad_picture), _array(grad_transmittance), geometry, blended,
        )  # fmt: skip
        in_threads(add_pairs, tiles.first_pair, geometry, blended, grad_ellipses, grad_features.numpy())
        met |= np.diff(tiles.first_pair) > 0
        del tiles, geometry, blended  # before the next run's are made
    in_threads(
        project_backward, _array(means), _array(quaternions), _array(scales), camera.numpy(), projected.ellipses, met, grad_ellipses,
        grad_means.numpy(), grad_quaternions.numpy(), grad_scales.numpy(), grad_opacities.numpy(),
    )  # fmt: skip
    return grad_means, grad_quaternions, grad_scales, grad_opacities, grad_features


@torch.library.register_fake(_splat_backward)
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


torch.library.register_autograd(_splat, _differentiate, setup_context=_save)


@dataclass(frozen=True)
class Tiles:
    """The Gaussians that touch the tiles of a run.

    The backward pass recomputes them, which is cheap; keeping them would take too much memory.
    """

    first: int  # tile of the run, row by row
    first_in_tile: np.ndarray  # [tiles + 1]
    gaussians: np.ndarray  # [pairs], tile by tile, front to back
    pairs: np.ndarray  # [pairs], the number of each pair, Gaussian by Gaussian
    first_pair: np.ndarray  # [g + 1]


@dataclass(frozen=True)
class Count:
    """The numbers of pairs of Gaussian and tile in a run of tiles."""

    first: int  # tile of the run, row by row
    rectangles: np.ndarray  # [g 4], first and end row and column of the tiles that a Gaussian touches
    first_pair: np.ndarray  # [g + 1], Gaussian by Gaussian
    counts: np.ndarray  # [SHARES tiles], of a share of the Gaussians in a tile

    @property
    def pairs(self) -> int:
        """The total number."""
        return int(self.first_pair[-1])


@dataclass(frozen=True)
class Projected:
    """Gaussians in the image plane, and their order in depth."""

    ellipses: np.ndarray  # [g 8]
    ranks: np.ndarray  # [g], place in the order, -1 where not drawn
    order: np.ndarray  # [drawn]
    size: tuple[int, int]  # height, width [px]

    @classmethod
    def of(
        cls, means: Tensor, quaternions: Tensor, scales: Tensor, opacities: Tensor, order: Tensor, camera: Tensor,
        height: int, width: int,
    ) -> "Projected":  # fmt: skip
        """Project Gaussians."""
        ellipses = np.empty((len(means), 8))
        in_threads(
            project, _array(means), _array(quaternions), _array(scales), _array(opacities), camera.numpy(), ellipses
        )
        ranks = np.full(len(means), -1, np.int32)
        ranks[order.numpy()] = np.arange(len(order), dtype=np.int32)
        return cls(ellipses, ranks, order.numpy(), (height, width))

    def count(self, run: range | None = None) -> Count:
        """The pairs of a run of tiles; None is all tiles."""
        height, width = self.size
        run = run or range(-(-height // TILE_HEIGHT) * -(-width // TILE_WIDTH))
        counts = np.zeros((SHARES, len(run)), np.int64)
        first_pair = np.zeros(len(self.ranks) + 1, np.int64)
        rectangles = np.empty((len(self.ranks), 4), np.int32)
        in_threads(count_pairs, self.ellipses, self.ranks, run.start, height, width, rectangles, first_pair[1:], counts)
        np.cumsum(first_pair, out=first_pair)
        return Count(run.start, rectangles, first_pair, counts)

    def runs(self) -> Iterator[Count]:
        """All tiles in runs of at most `PAIRS_AT_A_TIME` pairs, or of a single tile with more."""
        whole = self.count()
        if whole.pairs <= PAIRS_AT_A_TIME:
            yield whole
            return
        per_tile = whole.counts.sum(0)
        del whole
        for run in runs_of_tiles(per_tile, PAIRS_AT_A_TIME):
            yield self.count(run)

    def tiles(self, count: Count) -> Tiles:
        """Sort the Gaussians of a run into its tiles, front to back."""
        ends = np.cumsum(count.counts.T).reshape(-1, SHARES)
        first_in_tile = np.concatenate(([0], ends[:, -1]))
        starts = np.ascontiguousarray(ends.T) - count.counts
        pairs = np.empty(count.pairs, np.int64)
        run = (count.first, self.size[1], count.rectangles, count.first_pair)
        in_threads(fill_pairs, self.ellipses, self.ranks, *run, starts, pairs)
        gaussians = np.empty(len(pairs), np.int32)
        in_threads(sort_pairs, first_in_tile, self.order, pairs, gaussians)
        return Tiles(count.first, first_in_tile, gaussians, pairs, count.first_pair)


def runs_of_tiles(pairs: Int64[np.ndarray, " tiles"], most: int) -> list[range]:
    """All tiles, split into runs with at most `most` pairs in total, or of a single tile with more."""
    runs, first, held = [], 0, 0
    for tile, count in enumerate(pairs.tolist()):
        if held and held + count > most:
            runs.append(range(first, tile))
            first, held = tile, 0
        held += count
    return [*runs, range(first, len(pairs))]


def _array(tensor: Tensor) -> np.ndarray:
    return tensor.detach().contiguous().numpy()
