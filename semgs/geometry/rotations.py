"""Rotations: unit quaternions (w, x, y, z) and 3x3 matrices."""

from __future__ import annotations

import torch
from jaxtyping import Float
from torch import Tensor


def matrix_from_quaternion(quaternions: Float[Tensor, "*batch 4"]) -> Float[Tensor, "*batch 3 3"]:
    """Rotation matrix of a quaternion (w, x, y, z) of any length except zero."""
    w, x, y, z = torch.nn.functional.normalize(quaternions, dim=-1).unbind(-1)
    return torch.stack(
        (
            1 - 2 * (y * y + z * z), 2 * (x * y - w * z), 2 * (x * z + w * y),
            2 * (x * y + w * z), 1 - 2 * (x * x + z * z), 2 * (y * z - w * x),
            2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y),
        ),
        dim=-1,
    ).unflatten(-1, (3, 3))  # fmt: skip


def quaternion_from_matrix(matrices: Float[Tensor, "*batch 3 3"]) -> Float[Tensor, "*batch 4"]:
    """Unit quaternion (w, x, y, z) of a rotation matrix, w >= 0.

    There are four formulas; using the one with the largest divisor is exact for every rotation, including half-turns.
    """
    m = matrices
    diagonal = m.diagonal(dim1=-2, dim2=-1)
    trace = diagonal.sum(-1)
    squares = torch.cat(((1 + trace)[..., None], 1 + 2 * diagonal - trace[..., None]), dim=-1)  # 4 (w, x, y, z)^2
    a, b, c = m[..., 2, 1] - m[..., 1, 2], m[..., 0, 2] - m[..., 2, 0], m[..., 1, 0] - m[..., 0, 1]
    d, e, f = m[..., 0, 1] + m[..., 1, 0], m[..., 0, 2] + m[..., 2, 0], m[..., 1, 2] + m[..., 2, 1]
    s = squares
    products = torch.stack(  # row i is 4 q_i q
        (
            torch.stack((s[..., 0], a, b, c), -1),
            torch.stack((a, s[..., 1], d, e), -1),
            torch.stack((b, d, s[..., 2], f), -1),
            torch.stack((c, e, f, s[..., 3]), -1),
        ),
        dim=-2,
    )
    row = squares.argmax(-1)[..., None, None].expand(*squares.shape[:-1], 1, 4)
    quaternions = torch.nn.functional.normalize(products.gather(-2, row)[..., 0, :], dim=-1)
    return torch.where(quaternions[..., :1] < 0, -quaternions, quaternions)


def quaternion_product(a: Float[Tensor, "*#batch 4"], b: Float[Tensor, "*#batch 4"]) -> Float[Tensor, "*batch 4"]:
    """Hamilton product of quaternions (w, x, y, z): the rotation by `b`, then by `a`."""
    aw, ax, ay, az = a.unbind(-1)
    bw, bx, by, bz = b.unbind(-1)
    return torch.stack(
        (
            aw * bw - ax * bx - ay * by - az * bz,
            aw * bx + ax * bw + ay * bz - az * by,
            aw * by - ax * bz + ay * bw + az * bx,
            aw * bz + ax * by - ay * bx + az * bw,
        ),
        dim=-1,
    )


def nearest_rotation(matrices: Float[Tensor, "*batch 3 3"]) -> Float[Tensor, "*batch 3 3"]:
    """The rotation nearest to each matrix in the Frobenius norm (orthogonal Procrustes, determinant +1)."""
    u, _, vh = torch.linalg.svd(matrices)
    handedness = torch.linalg.det(u @ vh)
    flip = torch.ones_like(u[..., 0, :])
    flip[..., 2] = handedness
    return (u * flip[..., None, :]) @ vh


def why_no_rotation(matrix: Float[Tensor, "3 3"]) -> tuple[str, str | None]:
    """What a matrix does that a rotation does not, and what to do about it, None if that is unknown; for messages."""
    if torch.linalg.det(matrix) < 0:
        return "it mirrors", None
    lengths = matrix.norm(dim=0)
    directions = matrix / lengths
    if torch.allclose(directions.mT @ directions, torch.eye(3, dtype=matrix.dtype), rtol=0, atol=1e-2):
        first, second, third = lengths.tolist()
        equal = lengths.max() - lengths.min() < 1e-3 * lengths.max()
        scale = (
            f"it scales by {first:.4g}" if equal else f"its columns are {first:.4g}, {second:.4g} and {third:.4g} long"
        )
        return scale, "divide each of its three columns by its length"
    return ("it is singular" if torch.linalg.det(matrix) < 1e-6 else "it scales or shears"), None


def covariance(
    quaternions: Float[Tensor, "*batch 4"], scales: Float[Tensor, "*batch 3"]
) -> Float[Tensor, "*batch 3 3"]:
    """Covariance R S S^T R^T of Gaussians with axes `quaternions` (w, x, y, z) and standard deviations `scales`."""
    axes = matrix_from_quaternion(quaternions) * scales[..., None, :]
    return axes @ axes.mT
