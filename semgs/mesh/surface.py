"""Triangles on the zero of a signed distance field, by marching cubes, and fewer of them: with scikit-image and fast-simplification (extra `mesh`), which are optional."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
from jaxtyping import Float64, Int64

from semgs.files.errors import needs_extra
from semgs.mesh.fusion import SIDE, Field

LEAST_WEIGHT = 0.01
"""A voxel counts as observed from this weight: one view whose depth is off by 10 %, across the surface at 84 degrees from its normal. A surface with holes would be nearer to the truth, and
less use to look at or to stand on."""

STEEPEST = 0.75
"""Distances within a cell of a surface differ by sqrt(3) voxels at most, that is 0.43 truncations. If they differ by more than this, it is a step between what is near and what is far."""

ROOM = 8
"""Blocks along each side of the parts that marching cubes gets at once."""

SAME = 1 << 10
"""Vertices of neighbouring parts are one if they agree to one voxel divided by this."""

Vertices = Float64[np.ndarray, "_ 3"]
Faces = Int64[np.ndarray, "_ 3"]


def surface_of(field: Field) -> tuple[Vertices, Faces]:
    """Where a field is zero: vertices [unit of the scene] and faces, anticlockwise seen from the front.

    There are faces only in cells whose eight corners were all observed, so space that no view shows stays open.

    Raises:
        ImportError: scikit-image is not installed.
    """
    march = surface_library()
    points, faces, count = [np.zeros((0, 3))], [np.zeros((0, 3), np.int64)], 0
    rooms = np.unique(np.concatenate([(field.blocks - shift) // ROOM for shift in np.ndindex(2, 2, 2)]), axis=0)
    for room in rooms:
        distances, observed = _dense(field, room * ROOM)
        cells = np.ones(tuple(side - 1 for side in observed.shape), bool)
        low, high = np.ones(cells.shape, np.float32), -np.ones(cells.shape, np.float32)
        for x, y, z in np.ndindex(2, 2, 2):
            corner = np.s_[x : x + cells.shape[0], y : y + cells.shape[1], z : z + cells.shape[2]]
            cells &= observed[corner]
            low, high = np.minimum(low, distances[corner]), np.maximum(high, distances[corner])
        cells &= high - low <= STEEPEST
        if not (cells & (low <= 0) & (high > 0)).any():
            continue
        mask = np.zeros(observed.shape, bool)
        mask[1:, 1:, 1:] = cells  # scikit-image looks a cell up at its last corner
        found, triangles, *_ = march(distances, 0.0, mask=mask, gradient_direction="descent", allow_degenerate=False)
        points.append(found + room * ROOM * SIDE)
        faces.append(triangles.astype(np.int64) + count)
        count += len(found)
    return _welded(np.concatenate(points), np.concatenate(faces), field.voxel)


def _dense(field: Field, first: Int64[np.ndarray, " 3"]) -> tuple[np.ndarray, np.ndarray]:
    """Distances and whether they were observed in the blocks from a first one on, and in one more layer of voxels, which joins the next."""
    place = field.blocks - first
    inside = np.flatnonzero(((place >= 0) & (place <= ROOM)).all(1))
    side = (ROOM + 1) * SIDE
    distances, observed = np.ones((side,) * 3, np.float32), np.zeros((side,) * 3, bool)
    for block, (x, y, z) in zip(inside, SIDE * place[inside], strict=True):
        at = np.s_[x : x + SIDE, y : y + SIDE, z : z + SIDE]
        distances[at], observed[at] = field.distances[block], field.weights[block] >= LEAST_WEIGHT
    end = np.s_[: ROOM * SIDE + 1, : ROOM * SIDE + 1, : ROOM * SIDE + 1]
    return distances[end], observed[end]


def _welded(points: Vertices, faces: Faces, voxel: float) -> tuple[Vertices, Faces]:
    """A surface from its parts, whose points are in voxels: equal vertices are one, and faces that have two of them are left out."""
    _, first, owners = np.unique(
        np.round(points * SAME).astype(np.int64), axis=0, return_index=True, return_inverse=True
    )
    faces = owners.reshape(-1)[faces]
    faces = faces[(faces[:, 0] != faces[:, 1]) & (faces[:, 1] != faces[:, 2]) & (faces[:, 2] != faces[:, 0])]
    used, faces = np.unique(faces, return_inverse=True)
    return points[first[used]] * voxel, faces.reshape(-1, 3)


def simplified(vertices: Vertices, faces: Faces, count: int) -> tuple[Vertices, Faces]:
    """The same surface with about so many faces, by quadric error (Garland and Heckbert, SIGGRAPH 1997); unchanged if it has no more.

    Raises:
        ImportError: fast-simplification is not installed.
    """
    if len(faces) <= count:
        return vertices, faces
    found, triangles = simplify_library()(vertices, faces.astype(np.int32), target_count=count)
    return found.astype(np.float64), triangles.astype(np.int64)


def surface_library() -> Callable[..., Any]:
    """skimage.measure.marching_cubes.

    Raises:
        ImportError: scikit-image is not installed.
    """
    with needs_extra("mesh", "meshes need scikit-image", "skimage"):
        from skimage.measure import marching_cubes
    return marching_cubes


def simplify_library() -> Callable[..., Any]:
    """fast_simplification.simplify.

    Raises:
        ImportError: fast-simplification is not installed.
    """
    with needs_extra("mesh", "meshes with fewer faces need fast-simplification", "fast_simplification"):
        from fast_simplification import simplify
    return simplify


def check_mesh_libraries(fewer_faces: bool) -> None:
    """Check that meshes can be made, before long work starts.

    Args:
        fewer_faces: whether they are simplified.

    Raises:
        ImportError: a library is not installed.
    """
    surface_library()
    if fewer_faces:
        simplify_library()
