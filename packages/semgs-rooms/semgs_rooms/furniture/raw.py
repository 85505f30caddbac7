"""Read and check the meshes from Infinigen's environment, and detect broken ones."""

from __future__ import annotations

import zipfile
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from jaxtyping import Float32, Int32, Int64, UInt8
from scipy.sparse import coo_matrix
from scipy.sparse.csgraph import connected_components
from scipy.spatial import ConvexHull, QhullError

from semgs.files.errors import InputError
from semgs_rooms.furniture.kinds import Kind

FEWEST, MOST = 60, 130_000
"""Minimum and maximum number of triangles of an object."""
SAMPLES = 20_000
"""Number of points sampled on the surface."""
WELD = 1e-4
"""Corners closer than this are merged [m]."""
FEW = 0.02
"""Share of the surface at either end of a side that may be stray triangles."""
LOOSE = 0.01
"""Share of the surface that may be detached, such as a screw or a handle."""


@dataclass(frozen=True)
class RawMesh:
    """One object, as `program.py` wrote it.

    Attributes:
        vertices: in Infinigen's frame [m].
        faces: three vertex indices per triangle.
        uv: texture coordinates of the corners, (0, 0) at the image's lower left; zeros without an image.
        material: index of each triangle's material.
        materials: their names.
        picture: image of base colours, sRGB; no pixels if none was requested.
    """

    vertices: Float32[np.ndarray, "n 3"]
    faces: Int32[np.ndarray, "t 3"]
    uv: Float32[np.ndarray, "t 3 2"]
    material: Int32[np.ndarray, " t"]
    materials: tuple[str, ...]
    picture: UInt8[np.ndarray, "h w 3"]

    @property
    def sides(self) -> np.ndarray:
        """Sides of the bounding box [3] [m]."""
        return np.ptp(self.vertices[self.faces.ravel()].astype(np.float64), axis=0)


class Incomplete(Exception):
    """A piece is broken or has an unrealistic size; the message says why, on one line."""


def read_raw(path: Path, count: int) -> list[RawMesh]:
    """The objects in a file. Nothing in it is executed.

    Raises:
        InputError: it is not what `program.py` writes.
    """
    try:
        with np.load(path, allow_pickle=False) as file:
            return [_mesh({key: file[f"{number}/{key}"] for key in KEYS}) for number in range(count)]
    except (OSError, ValueError, KeyError, EOFError, zipfile.BadZipFile) as error:
        raise InputError(path, "arrays of a generated piece", f"{type(error).__name__}: {error}") from error


KEYS = ("vertices", "faces", "uv", "material", "materials", "picture")


def _mesh(arrays: dict[str, np.ndarray]) -> RawMesh:
    """The object in some arrays; a ValueError if they are inconsistent."""
    vertices, faces, uv, material = (arrays[key] for key in KEYS[:4])
    count = len(faces)
    wanted = {
        "vertices": (np.float32, (len(vertices), 3)),
        "faces": (np.int32, (count, 3)),
        "uv": (np.float32, (count, 3, 2)),
        "material": (np.int32, (count,)),
        "materials": (None, (len(arrays["materials"]),)),
        "picture": (np.uint8, (*arrays["picture"].shape[:2], 3)),
    }
    for key, (dtype, shape) in wanted.items():
        array = arrays[key]
        if array.shape != shape or (array.dtype != dtype if dtype else array.dtype.kind != "U"):
            raise ValueError(f"{key} is {array.dtype} {array.shape}")
    if not (np.isfinite(vertices).all() and np.isfinite(uv).all()):
        raise ValueError("a number that is not finite")
    for key, numbers, limit in (("faces", faces, len(vertices)), ("material", material, len(arrays["materials"]))):
        if count and (numbers.min() < 0 or numbers.max() >= limit):
            raise ValueError(f"{key} refer to {numbers.min()}..{numbers.max()} of {limit}")
    names = tuple(str(name) for name in arrays["materials"])
    return RawMesh(vertices, faces, uv, material, names, arrays["picture"])


def check_complete(mesh: RawMesh, kind: Kind) -> None:
    """Refuse broken pieces.

    Raises:
        Incomplete: the piece has too few or too many triangles, is far too large, has stray triangles, fills too little of its
            bounding box, or has detached parts.
    """
    count, sides = len(mesh.faces), mesh.sides if len(mesh.faces) else np.zeros(3)
    if not FEWEST <= count <= MOST:
        raise Incomplete(f"{count} triangles")
    if sides.max() > kind.largest or sides.min() < 0.01:
        raise Incomplete(f"{_metres(sides)} large")
    corners = mesh.vertices[mesh.faces].astype(np.float64)
    points = _on_surface(corners)
    core = (np.ptp(np.quantile(points, (FEW, 1 - FEW), axis=0), axis=0) / sides).min()
    if core < kind.core:
        raise Incomplete(f"stray triangles: most of the surface spans only {core:.2f} of a side")
    hull = _hull(points) / sides.prod()
    if hull < kind.hull:
        raise Incomplete(f"its convex hull fills only {hull:.2f} of its bounding box")
    loose = _loose(mesh, corners, kind.gap)
    if loose > LOOSE:
        raise Incomplete(f"{loose:.2f} of its surface is detached")


def _on_surface(corners: np.ndarray) -> np.ndarray:
    """Points distributed evenly over triangles [s 3]."""
    rng = np.random.default_rng(0)
    area = np.linalg.norm(np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]), axis=-1)
    chosen = corners[rng.choice(len(corners), SAMPLES, p=area / area.sum())] if area.sum() > 0 else corners
    a, b = np.sqrt(rng.random((len(chosen), 1))), rng.random((len(chosen), 1))
    return (1 - a) * chosen[:, 0] + a * (1 - b) * chosen[:, 1] + a * b * chosen[:, 2]


def _hull(points: np.ndarray) -> float:
    """Volume of the convex hull [m^3]."""
    try:
        return float(ConvexHull(points).volume)
    except QhullError:
        return 0.0


def _loose(mesh: RawMesh, corners: np.ndarray, gap: float) -> float:
    """Share of the surface outside the largest cluster of parts; parts belong together if their boxes are closer than `gap`."""
    parts = connected_parts(mesh.vertices, mesh.faces)
    count = int(parts.max()) + 1
    area = np.linalg.norm(np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]), axis=-1)
    lowest, highest = np.full((count, 3), np.inf), np.full((count, 3), -np.inf)
    np.minimum.at(lowest, parts, corners.min(axis=1))
    np.maximum.at(highest, parts, corners.max(axis=1))
    rows, columns = [], []
    for part in range(count):
        near = ((lowest <= highest[part] + gap) & (highest >= lowest[part] - gap)).all(axis=1)
        columns.append(np.flatnonzero(near))
        rows.append(np.full(len(columns[-1]), part))
    row, column = np.concatenate(rows), np.concatenate(columns)
    _, cluster = connected_components(coo_matrix((np.ones(len(row)), (row, column)), shape=(count, count)), False)
    shares = np.bincount(cluster[parts], weights=area) / max(area.sum(), 1e-12)
    return float(1 - shares.max())


def connected_parts(vertices: Float32[np.ndarray, "n 3"], faces: Int32[np.ndarray, "t 3"]) -> Int64[np.ndarray, " t"]:
    """Index of the connected part of each triangle; corners at the same position are connected."""
    places = np.unique(np.round(vertices / WELD).astype(np.int64), axis=0, return_inverse=True)[1].reshape(-1)[faces]
    count = int(places.max()) + 1
    row, column = places[:, (0, 1)].ravel(), places[:, (1, 2)].ravel()
    _, part = connected_components(coo_matrix((np.ones(len(row)), (row, column)), shape=(count, count)), False)
    return np.unique(part[places[:, 0]], return_inverse=True)[1].reshape(-1)


def _metres(sides: np.ndarray) -> str:
    return " x ".join(f"{side:.2f}" for side in sides) + " m"
