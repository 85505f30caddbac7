"""Parts of furniture: simple shapes and triangle meshes, with a label and a material, and their triangles.

A piece of furniture has its base at z = 0, its back at y = 0, its front towards +y, and x from 0 to its width.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cache
from itertools import pairwise

import numpy as np
from jaxtyping import Float, Float32, Float64, Int64

from semgs_rooms.pieces import shell_kernels as kernels
from semgs_rooms.pieces.materials import Material, Range

Triple = tuple[float | int, float | int, float | int]
"""A position or a size (x, y, z) [m]."""

BOX, CYLINDER, BALL, CUSHION, SHELL = range(5)
"""Shapes, each filling its size: a cuboid; an upright elliptic cylinder; an ellipsoid; |x|^4 + |y|^4 + |z|^4 = 1; a triangle mesh."""

CREASE = float(np.cos(np.radians(40)))
"""Cosine of the crease angle: faces that meet at a smaller angle are shaded as one smooth surface."""
WELD = 1e-5
"""Corners closer than this are merged [m]."""


@dataclass(frozen=True)
class Solid:
    """One solid.

    Attributes:
        label: its class, 255 = ignore.
        material: numbers for the texture kernels.
        centre: in the frame of the piece or of the room [m].
        size: full extents along its own axes [m].
        shape: BOX, CYLINDER, BALL, CUSHION or SHELL.
        yaw: rotation about z [rad].
        tilt: rotation about its own x axis, applied before the yaw [rad].
        shell: the triangles of a SHELL, relative to its centre.
    """

    label: int
    material: Material
    centre: Triple
    size: Triple
    shape: int = BOX
    yaw: float = 0.0
    tilt: float = 0.0
    shell: Shell | None = None


@dataclass(frozen=True)
class Piece:
    """A piece of furniture in its own frame.

    Attributes:
        name: what it is; placement and asset rules depend on it.
        size: width (x), depth (y), height (z) [m].
        parts: its solids.
        surface: height of a top for small things [m], None if there is none.
    """

    name: str
    size: Triple
    parts: tuple[Solid, ...]
    surface: float | None = None


@dataclass(frozen=True)
class Solids:
    """All parts of a room as arrays.

    Attributes:
        rotations: axes of each part in the room (columns).
        centres: [m].
        sizes: full extents [m].
        shapes: BOX, CYLINDER, BALL, CUSHION or SHELL.
        labels: class of each part, 255 = ignore.
        materials: numbers for the texture kernels.
    """

    rotations: Float64[np.ndarray, "p 3 3"]
    centres: Float64[np.ndarray, "p 3"]
    sizes: Float64[np.ndarray, "p 3"]
    shapes: Int64[np.ndarray, " p"]
    labels: Int64[np.ndarray, " p"]
    materials: Float64[np.ndarray, "p m"]


def block(
    label: int, material: Material, low: Triple, high: Triple, shape: int = BOX, yaw: float = 0.0, tilt: float = 0.0
) -> Solid:
    """A part from two opposite corners, rotated about its centre."""
    centre = ((low[0] + high[0]) / 2, (low[1] + high[1]) / 2, (low[2] + high[2]) / 2)
    size = (high[0] - low[0], high[1] - low[1], high[2] - low[2])
    return Solid(label, material, centre, size, shape, yaw, tilt)


def post(label: int, material: Material, middle: tuple[float, float], radius: float, low: float, high: float) -> Solid:
    """An upright round cylinder centred at (x, y)."""
    x, y = middle
    return block(label, material, (x - radius, y - radius, low), (x + radius, y + radius, high), CYLINDER)


def ring(
    label: int, material: Material, outer: tuple[Range, Range], inner: tuple[Range, Range], upwards: Range
) -> list[Solid]:
    """Four blocks around a hole, left and right over the whole depth, near and far; rectangles are given as ranges of x and y."""
    (left, right), (near, far) = outer
    (start, end), (front, back) = inner
    low, high = upwards
    sides = ((left, near, start, far), (end, near, right, far), (start, near, end, front), (start, back, end, far))
    return [block(label, material, (a, b, low), (c, d, high)) for a, b, c, d in sides]


def move(parts: Sequence[Solid], origin: Triple, yaw: float = 0.0) -> list[Solid]:
    """Parts rotated about z, then translated."""
    cosine, sine = float(np.cos(yaw)), float(np.sin(yaw))
    result = []
    for part in parts:
        x, y, z = part.centre
        centre = (cosine * x - sine * y + origin[0], sine * x + cosine * y + origin[1], z + origin[2])
        result.append(replace(part, centre=centre, yaw=part.yaw + yaw))
    return result


def gather(parts: Sequence[Solid]) -> Solids:
    """Parts as arrays."""
    yaw = np.array([part.yaw for part in parts])
    tilt = np.array([part.tilt for part in parts])
    rotations = np.zeros((len(parts), 3, 3))
    rotations[:, 0, 0], rotations[:, 1, 0] = np.cos(yaw), np.sin(yaw)
    rotations[:, 0, 1], rotations[:, 1, 1] = -np.sin(yaw) * np.cos(tilt), np.cos(yaw) * np.cos(tilt)
    rotations[:, 2, 1] = np.sin(tilt)
    rotations[:, 0, 2], rotations[:, 1, 2] = np.sin(yaw) * np.sin(tilt), -np.cos(yaw) * np.sin(tilt)
    rotations[:, 2, 2] = np.cos(tilt)
    centres, sizes = (np.array([getattr(part, name) for part in parts], np.float64) for name in ("centre", "size"))
    shapes, labels = (np.array([getattr(part, name) for part in parts], np.int64) for name in ("shape", "label"))
    return Solids(rotations, centres, sizes, shapes, labels, np.array([part.material for part in parts]))


def triangulate(solids: Solids) -> tuple[Float64[np.ndarray, "t 3 3"], Int64[np.ndarray, " t"]]:
    """Corners of all triangles except those of shells [m], and the part each belongs to."""
    corners, owners = [], []
    for shape in range(4):
        which = np.flatnonzero(solids.shapes == shape)
        if len(which) == 0:
            continue
        template = _template(shape)
        scaled = template[None] * solids.sizes[which][:, None, None]
        placed = np.einsum("pij,ptcj->ptci", solids.rotations[which], scaled) + solids.centres[which][:, None, None]
        corners.append(placed.reshape(-1, 3, 3))
        owners.append(np.repeat(which, len(template)))
    return np.concatenate(corners), np.concatenate(owners)


@cache
def _template(shape: int) -> Float64[np.ndarray, "t 3 3"]:
    """Triangles of a shape of size 1, centred on the origin."""
    if shape == BOX:
        unit = np.array([[x, y, z] for x in (-0.5, 0.5) for y in (-0.5, 0.5) for z in (-0.5, 0.5)])
        quads = [(0, 1, 3, 2), (4, 6, 7, 5), (0, 4, 5, 1), (2, 3, 7, 6), (0, 2, 6, 4), (1, 5, 7, 3)]
        return np.array([unit[list(t)] for a, b, c, d in quads for t in ((a, b, c), (a, c, d))])
    if shape == CYLINDER:
        turn = np.linspace(0, 2 * np.pi, 17)[:-1]
        ring = 0.5 * np.stack((np.cos(turn), np.sin(turn)), axis=-1)
        rows = [np.column_stack((ring * r, np.full(16, z))) for r, z in ((0, -0.5), (1, -0.5), (1, 0.5), (0, 0.5))]
        return _stitched(rows)
    turn = np.linspace(0, 2 * np.pi, 17)[:-1] + (np.pi / 16 if shape == CUSHION else 0)
    rise = np.linspace(-np.pi / 2, np.pi / 2, 9)
    exponent = 0.5 if shape == CUSHION else 1.0

    def power(value: np.ndarray | np.floating) -> np.ndarray | np.floating:
        return np.sign(value) * np.abs(value) ** exponent

    rows = []
    for angle in rise:
        flat = round(float(np.cos(angle)), 12) ** exponent
        height = np.full(16, float(power(np.sin(angle))))
        rows.append(0.5 * np.column_stack((flat * power(np.cos(turn)), flat * power(np.sin(turn)), height)))
    return _stitched(rows)


def _stitched(rows: Sequence[np.ndarray]) -> Float64[np.ndarray, "t 3 3"]:
    """Triangles between rings of equally many points, without degenerate ones (at poles)."""
    triangles = []
    for below, above in pairwise(rows):
        for i in range(len(below)):
            j = (i + 1) % len(below)
            triangles += [(below[i], below[j], above[j]), (below[i], above[j], above[i])]
    faces = np.array(triangles)
    area = np.linalg.norm(np.cross(faces[:, 1] - faces[:, 0], faces[:, 2] - faces[:, 0]), axis=-1)
    return faces[area > 1e-9]


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
