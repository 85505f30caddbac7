"""Plane sweep: depth candidates, and the position of a reference texel in a source view at each of them."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

import torch
from jaxtyping import Float, Float64
from torch import Tensor

from semgs.geometry.cameras import Cameras, inverse_rigid


@dataclass(frozen=True)
class Sweep:
    """The projective map from reference texels at a depth to texels of a source view.

    (u z, v z, z) = matrix [x, y, 1] depth + offset, where (x, y) and (u, v) are integer texel positions (the centre of the
    first texel is 0) and z is the depth in the source view.

    Attributes:
        matrix: K_s R K_r^-1 with the shifts to texel positions.
        offset: K_s t with the shift.
    """

    matrix: Float64[Tensor, "*batch 3 3"]
    offset: Float64[Tensor, "*batch 3"]


def depth_candidates(
    depth_range: Float[Tensor, "*batch 2"], count: int, sampling: Literal["inverse", "linear"] = "inverse"
) -> Float[Tensor, "*batch candidates"]:
    """Candidate depths from far (index 0) to near [m], uniform in inverse depth or in depth."""
    near, far = depth_range[..., :1], depth_range[..., 1:]
    steps = torch.linspace(0, 1, count, dtype=depth_range.dtype, device=depth_range.device)
    if sampling == "inverse":
        return 1 / (1 / far + steps * (1 / near - 1 / far))
    return far + steps * (near - far)


def expected_depth(
    probabilities: Float[Tensor, "*batch candidates h w"],
    candidates: Float[Tensor, "*batch candidates"],
    sampling: Literal["inverse", "linear"] = "inverse",
) -> Float[Tensor, "*batch h w"]:
    """Expectation over depth candidates: 1 / sum p / d (`inverse`), or sum p d (`linear`) [m]."""
    d = candidates[..., None, None]
    if sampling == "inverse":
        return 1 / (probabilities / d).sum(-3)
    return (probabilities * d).sum(-3)


def sweep(
    reference: Cameras,
    source: Cameras,
    grid: tuple[int, int],
    *,
    own_intrinsics: bool = True,
    pixel_centres: bool = True,
) -> Sweep:
    """The projective map between feature maps of two sets of cameras, in float64.

    Args:
        reference: [*batch].
        source: [*batch], with the same image size.
        grid: (height, width) of the feature maps, which cover the images.
        own_intrinsics: project with the source's own K; else with the reference's.
        pixel_centres: texel centres are at .5, like those of pixels; else at integers.
    """
    height, width = reference.size
    to_grid = torch.diag(torch.tensor([grid[1] / width, grid[0] / height, 1.0], dtype=torch.float64))
    shift = torch.eye(3, dtype=torch.float64)
    if pixel_centres:
        shift[0, 2] = shift[1, 2] = -0.5
    reference_k = shift @ to_grid @ reference.intrinsics
    source_k = shift @ to_grid @ source.intrinsics if own_intrinsics else reference_k
    source_from_reference = inverse_rigid(source.world_from_camera) @ reference.world_from_camera
    return Sweep(
        source_k @ source_from_reference[..., :3, :3] @ torch.linalg.inv(reference_k),
        (source_k @ source_from_reference[..., :3, 3:])[..., 0],
    )
