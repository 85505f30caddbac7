"""Spherical harmonics: colour that depends on the viewing direction, in the real basis of 3D Gaussian splatting.

Degree order: k = (degree, order) = (0, 0), (1, -1), (1, 0), (1, 1), (2, -2), ...; degree d ends at k = (d + 1)^2.
"""

from __future__ import annotations

from math import pi, sqrt

import torch
from jaxtyping import Float
from torch import Tensor

MAX_DEGREE = 3
"""The highest degree of the format."""

DEGREE_0 = sqrt(1 / (4 * pi))
"""The constant harmonic Y_00: a colour c in 0..1 is the coefficient (c - 0.5) / DEGREE_0."""


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
