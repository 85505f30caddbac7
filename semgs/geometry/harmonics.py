"""Spherical harmonics: colour that depends on the viewing direction, in the real basis of 3D Gaussian splatting; and its rotation.

Degree order: k = (degree, order) = (0, 0), (1, -1), (1, 0), (1, 1), (2, -2), ...; degree d ends at k = (d + 1)^2.

To rotate, instead of Wigner matrices in closed form, this solves for the coefficients that reproduce the rotated function in many directions. That
is exact up to rounding, for any basis that is closed under rotation.
"""

from __future__ import annotations

from functools import lru_cache
from math import pi, sqrt

import torch
from jaxtyping import Float, Float64
from torch import Tensor

MAX_DEGREE = 3
"""The highest degree of the format."""

DEGREE_0 = sqrt(1 / (4 * pi))
"""The constant harmonic Y_00: a colour c in 0..1 is the coefficient (c - 0.5) / DEGREE_0."""

SAMPLES = 64
"""Directions in which functions are compared; any number well above the 16 coefficients will do."""


def basis(directions: Float[Tensor, "*batch 3"], degree: int) -> Float[Tensor, "*batch k"]:
    """Real spherical harmonics of unit directions up to `degree`, with 3DGS's signs (Condon-Shortley phase kept).

    Raises:
        ValueError: the degree is not 0 to 3.
    """
    if not 0 <= degree <= MAX_DEGREE:
        raise ValueError(f"degree is {degree}; expected 0 to {MAX_DEGREE}")
    x, y, z = directions.unbind(-1)
    values = [torch.full_like(x, DEGREE_0)]
    if degree >= 1:
        c = sqrt(3 / (4 * pi))
        values += [-c * y, c * z, -c * x]
    if degree >= 2:
        c = sqrt(15 / (4 * pi))
        xx, yy, zz = x * x, y * y, z * z
        values += [
            c * x * y,
            -c * y * z,
            sqrt(5 / (16 * pi)) * (2 * zz - xx - yy),
            -c * x * z,
            c / 2 * (xx - yy),
        ]
    if degree >= 3:
        a, b, c = sqrt(35 / (32 * pi)), sqrt(105 / (4 * pi)), sqrt(21 / (32 * pi))
        values += [
            -a * y * (3 * xx - yy),
            b * x * y * z,
            -c * y * (4 * zz - xx - yy),
            sqrt(7 / (16 * pi)) * z * (2 * zz - 3 * xx - 3 * yy),
            -c * x * (4 * zz - xx - yy),
            b / 2 * z * (xx - yy),
            -a * x * (xx - 3 * yy),
        ]
    return torch.stack(values, dim=-1)


def colours_from_harmonics(
    harmonics: Float[Tensor, "*batch k 3"], directions: Float[Tensor, "*batch 3"]
) -> Float[Tensor, "*batch 3"]:
    """Colour seen along `directions`: max(0, 0.5 + sum_k basis_k(direction) harmonics_k); not clamped above.

    Args:
        harmonics: coefficients in degree order, k = 1, 4, 9 or 16.
        directions: from the camera to the Gaussian, unit length.

    Raises:
        ValueError: k has another value.
    """
    degrees = {(degree + 1) ** 2: degree for degree in range(MAX_DEGREE + 1)}
    degree = degrees.get(harmonics.shape[-2])
    if degree is None:
        raise ValueError(f"harmonics are {tuple(harmonics.shape)}; expected [... k 3] with k = 1, 4, 9 or 16")
    return (0.5 + torch.einsum("...k,...kc->...c", basis(directions, degree), harmonics)).clamp_min(0)


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
