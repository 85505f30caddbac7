"""Shells: triangle meshes with normals and texture coordinates, for parts that are not simple solids."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from jaxtyping import Float, Float32, Float64, Int64

from semgs_rooms.pieces import shell_kernels as kernels

CREASE = float(np.cos(np.radians(40)))
"""Cosine of the crease angle: faces that meet at a smaller angle are shaded as one smooth surface."""
WELD = 1e-5
"""Corners closer than this are merged [m]."""


@dataclass(frozen=True)
class Shell:
    """Triangles with normals and texture coordinates. Those of a part are centred on their bounding box.

    Attributes:
        corners: [m].
        normals: unit normal at each corner.
        uv: texture coordinates at each corner, (0, 0) at the image's upper left.
    """

    corners: Float32[np.ndarray, "t 3 3"]
    normals: Float32[np.ndarray, "t 3 3"]
    uv: Float32[np.ndarray, "t 3 2"]


@dataclass(frozen=True)
class ShellTriangles:
    """The triangles of all shells of a room. In the room's triangle list they follow those of the solids.

    Attributes:
        first: index of the first one in that list.
        corners: [m].
        normals: unit normals at the corners.
        uv: texture coordinates at the corners.
        density: share of the texture that a metre spans (square root of the ratio of areas) [1/m].
        owners: the part that each belongs to.
    """

    first: int
    corners: Float64[np.ndarray, "t 3 3"]
    normals: Float64[np.ndarray, "t 3 3"]
    uv: Float64[np.ndarray, "t 3 2"]
    density: Float64[np.ndarray, " t"]
    owners: Int64[np.ndarray, " t"]


def place_shells(
    shells: Sequence[tuple[int, Shell]],
    rotations: Float64[np.ndarray, "p 3 3"],
    centres: Float64[np.ndarray, "p 3"],
    first: int,
) -> ShellTriangles:
    """Shells moved to where their parts are in the room.

    Args:
        shells: index of the part, and its shell.
        rotations: axes of each part in the room (columns).
        centres: of each part [m].
        first: number of triangles of the solids.
    """
    if not shells:
        empty = np.zeros((0, 3, 3))
        return ShellTriangles(first, empty, empty, empty[..., :2], empty[:, 0, 0], np.zeros(0, np.int64))
    corners = np.concatenate([s.corners @ rotations[p].T + centres[p] for p, s in shells])
    normals = np.concatenate([s.normals @ rotations[p].T for p, s in shells])
    uv = np.concatenate([s.uv for _, s in shells]).astype(np.float64)
    area = np.linalg.norm(np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]), axis=-1)
    a, b = uv[:, 1] - uv[:, 0], uv[:, 2] - uv[:, 0]
    density = np.sqrt(np.abs(a[:, 0] * b[:, 1] - a[:, 1] * b[:, 0]) / np.maximum(area, 1e-12))
    owners = np.repeat([p for p, _ in shells], [len(s.corners) for _, s in shells])
    return ShellTriangles(first, corners, normals, uv, density, owners)


def corner_normals(corners: Float[np.ndarray, "t 3 3"]) -> Float32[np.ndarray, "t 3 3"]:
    """A normal for each corner: the area-weighted mean of the faces that meet there at less than the crease angle."""
    faces = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]).astype(np.float64)
    groups = _groups(np.round(corners.reshape(-1, 3) / WELD).astype(np.int64))
    order = np.argsort(groups, kind="stable")
    normals = np.empty((3 * len(corners), 3), np.float32)
    kernels.mean_normals(groups, order, faces, CREASE, normals)
    return normals.reshape(-1, 3, 3)


def _groups(places: Int64[np.ndarray, "n 3"]) -> Int64[np.ndarray, " n"]:
    """Numbers that are equal where positions are."""
    span = places.max(axis=0) - places.min(axis=0) + 1
    x, y, z = (places - places.min(axis=0)).T
    return np.unique((x * span[1] + y) * span[2] + z, return_inverse=True)[1].reshape(-1)
