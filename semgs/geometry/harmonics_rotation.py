"""Rotation of harmonics: the coefficients of a colour function after its object was rotated.

Instead of Wigner matrices in closed form, this solves for the coefficients that reproduce the rotated function in many directions. That
is exact up to rounding, for any basis that is closed under rotation.
"""

from __future__ import annotations

from functools import lru_cache
from math import pi, sqrt

import torch
from jaxtyping import Float, Float64
from torch import Tensor

from semgs.geometry.harmonics import basis

SAMPLES = 64
"""Directions in which functions are compared; any number well above the 16 coefficients will do."""


def rotate_harmonics(
    harmonics: Float[Tensor, "n g k 3"], rotations: Float[Tensor, "n 3 3"], *, mvsplat_basis: bool = False
) -> Float[Tensor, "n g k 3"]:
    """Coefficients in the world of colours given in each camera's frame, in the standard 3DGS basis.

    Args:
        harmonics: of g Gaussians of each of n cameras, k = 1, 4, 9 or 16.
        rotations: world from camera.
        mvsplat_basis: rotate the coefficients in e3nn's basis, then read them in the basis of MVSplat's renderer, which is e3nn's after
            a half-turn about y; else everything is in the standard basis.
    """
    count = harmonics.shape[-2]
    if count == 1:
        return harmonics
    matrix = rotation_matrix(rotations.to("cpu", torch.float64), round(sqrt(count)) - 1, mvsplat_basis=mvsplat_basis)
    return torch.einsum("nij,ngjc->ngic", matrix.to(harmonics), harmonics)


def rotation_matrix(
    rotations: Float64[Tensor, "n 3 3"], degree: int, *, mvsplat_basis: bool = False
) -> Float64[Tensor, "n k k"]:
    """The matrix that rotates coefficients up to `degree`: Y(d) M c = Y(R^T d) c for all directions d."""
    directions, solve = _samples(degree)
    turned = directions @ rotations  # rows are R^T d
    if not mvsplat_basis:
        return solve @ basis(turned, degree)
    # e3nn's basis at (a, b, c) is the standard one at (-c, -a, b); MVSplat's renderer has the standard one at (z, x, y).
    e3nn = _e3nn_solve(degree) @ basis(_e3nn(turned), degree)
    return solve @ basis(directions.roll(1, dims=-1), degree) @ e3nn


def _e3nn(directions: Float64[Tensor, "*batch 3"]) -> Float64[Tensor, "*batch 3"]:
    a, b, c = directions.unbind(-1)
    return torch.stack((-c, -a, b), dim=-1)


@lru_cache(maxsize=4)
def _samples(degree: int) -> tuple[Tensor, Tensor]:
    """Directions spread over the sphere (a Fibonacci spiral), and the pseudo-inverse of the basis there."""
    index = torch.arange(SAMPLES, dtype=torch.float64) + 0.5
    z = 1 - 2 * index / SAMPLES
    angle = index * pi * (3 - sqrt(5))
    radius = (1 - z * z).sqrt()
    directions = torch.stack((radius * angle.cos(), radius * angle.sin(), z), dim=-1)
    return directions, torch.linalg.pinv(basis(directions, degree))


@lru_cache(maxsize=4)
def _e3nn_solve(degree: int) -> Tensor:
    """The pseudo-inverse of e3nn's basis in the same directions."""
    return torch.linalg.pinv(basis(_e3nn(_samples(degree)[0]), degree))
