"""Surfaces of a piece: triangles of one material, to be rotated, scaled, split and written."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import cv2
import numpy as np
from jaxtyping import Bool, Float64, Int, UInt8

from semgs.data.raycast import Raycaster
from semgs_rooms.assets.glb import Primitive
from semgs_rooms.furniture.raw import RawMesh

QUALITY = 85
"""Quality of the JPEG textures in the files."""
DIRECTIONS, NEAR = 40, 1e-4
"""Directions from which triangles are checked for visibility, and the offset of the rays from them, relative to the piece's size."""
PLACES = np.array([[1, 1, 1], [2.4, 0.3, 0.3], [0.3, 2.4, 0.3], [0.3, 0.3, 2.4]]) / 3
"""Points of a triangle that are checked (barycentric)."""


@dataclass(frozen=True)
class Surface:
    """Triangles of one material, z up.

    Attributes:
        name: part of the names of its node and material.
        vertices: [m].
        faces: three vertex indices per triangle.
        uv: texture coordinates of the vertices, (0, 0) at the image's upper left.
        picture: texture, sRGB, None if there is none.
        colour: linear RGB, multiplied with the texture.
        label: class of this part, None if it is that of the piece.
    """

    name: str
    vertices: Float64[np.ndarray, "n 3"]
    faces: Int[np.ndarray, "t 3"]
    uv: Float64[np.ndarray, "n 2"]
    picture: UInt8[np.ndarray, "h w 3"] | None = None
    colour: tuple[float, float, float] = (1.0, 1.0, 1.0)
    label: str | None = None


def surface(
    mesh: RawMesh, name: str, wanted: Bool[np.ndarray, " t"] | None = None, *,
    picture: UInt8[np.ndarray, "h w 3"] | None = None, colour: tuple[float, float, float] = (1.0, 1.0, 1.0),
    label: str | None = None,
) -> Surface:  # fmt: skip
    """All or some triangles of an object; without `picture`, its texture coordinates are dropped."""
    chosen = np.ones(len(mesh.faces), bool) if wanted is None else wanted
    corners = mesh.faces[chosen].reshape(-1)
    uv = mesh.uv[chosen].reshape(-1, 2).astype(np.float64) * [1, -1] + [0, 1]
    if picture is None:
        uv = np.zeros_like(uv)
    keys = np.concatenate((corners[:, None], np.round(uv * 8192).astype(np.int64)), axis=1)
    _, first, inverse = np.unique(keys, axis=0, return_index=True, return_inverse=True)
    vertices = mesh.vertices[corners[first]].astype(np.float64)
    return Surface(name, vertices, inverse.reshape(-1, 3), uv[first], picture, colour, label)


def sides(surfaces: Sequence[Surface]) -> Float64[np.ndarray, " 3"]:
    """Sides of the bounding box [m]."""
    lowest, highest = box(surfaces)
    return highest - lowest


def box(surfaces: Sequence[Surface]) -> tuple[Float64[np.ndarray, " 3"], Float64[np.ndarray, " 3"]]:
    """Lowest and highest corner of the bounding box [m]."""
    points = np.concatenate([part.vertices[part.faces.reshape(-1)] for part in surfaces])
    return points.min(axis=0), points.max(axis=0)


def turn(surfaces: Sequence[Surface]) -> list[Surface]:
    """Rotated by 90 degrees clockwise, seen from above: +x becomes -y."""
    return [replace(part, vertices=part.vertices[:, (1, 0, 2)] * [1, -1, 1]) for part in surfaces]


def scale(surfaces: Sequence[Surface], factors: Float64[np.ndarray, " 3"]) -> list[Surface]:
    """Scaled along the axes, with the base at z = 0 and centred in x and y."""
    lowest, highest = box(surfaces)
    foot = np.array([*((lowest + highest) / 2)[:2], lowest[2]])
    return [replace(part, vertices=(part.vertices - foot) * factors) for part in surfaces]


def shift(part: Surface, by: Sequence[float]) -> Surface:
    """Moved by a vector [m]."""
    return replace(part, vertices=part.vertices + np.array(by))


def flip(part: Surface) -> Surface:
    """Left and right exchanged."""
    return replace(part, vertices=part.vertices * [-1, 1, 1], faces=part.faces[:, ::-1])


def merge(surfaces: Sequence[Surface]) -> Surface:
    """Several surfaces of one material as one."""
    starts = np.cumsum([0, *(len(part.vertices) for part in surfaces)])
    faces = np.concatenate([part.faces + start for part, start in zip(surfaces, starts, strict=False)])
    vertices, uv = (np.concatenate([getattr(part, name) for part in surfaces]) for name in ("vertices", "uv"))
    return replace(surfaces[0], vertices=vertices, faces=faces, uv=uv)


def remove_hidden(part: Surface) -> Surface:
    """The surface without triangles that are invisible from outside, such as drawers behind fronts.

    Raises:
        ImportError: embreex is not installed.
    """
    rays = Raycaster(part.vertices, part.faces)
    corners = part.vertices[part.faces]
    normals = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    normals /= np.maximum(np.linalg.norm(normals, axis=1, keepdims=True), 1e-12)
    off = NEAR * float(np.ptp(part.vertices, axis=0).max())
    seen = np.zeros(len(corners), bool)
    for way in _sphere(DIRECTIONS):
        for place in PLACES:
            hidden = np.flatnonzero(~seen)
            side = np.where(normals[hidden] @ way < 0, -1.0, 1.0)[:, None]
            starts = np.einsum("tvc,v->tc", corners[hidden], place) + off * side * normals[hidden]
            seen[hidden[rays.reached(starts, np.tile(way, (len(hidden), 1)))]] = True
    used, faces = np.unique(part.faces[seen], return_inverse=True)
    return replace(part, vertices=part.vertices[used], faces=faces.reshape(-1, 3), uv=part.uv[used])


def _sphere(count: int) -> Float64[np.ndarray, "c 3"]:
    """Directions distributed evenly over the sphere (Fibonacci spiral)."""
    index = np.arange(count) + 0.5
    z, turn = 1 - 2 * index / count, np.pi * (1 + 5**0.5) * index
    flat = np.sqrt(1 - z**2)
    return np.stack((flat * np.cos(turn), flat * np.sin(turn), z), axis=1)


def primitives(surfaces: Sequence[Surface]) -> list[Primitive]:
    """The surfaces for a .glb file: one node and one material each; equal images are encoded once."""
    encoded: dict[int, bytes] = {}
    written = []
    for number, part in enumerate(surfaces):
        texture = None
        if part.picture is not None:
            if id(part.picture) not in encoded:
                encoded[id(part.picture)] = _jpeg(part.picture)
            texture = encoded[id(part.picture)]
        vertices, faces, uv = part.vertices.astype(np.float32), part.faces.astype(np.int64), part.uv.astype(np.float32)
        name, material = surface_node_name(number, part), f"m{number}_{part.name}"
        written.append(Primitive(name, material, vertices, faces, uv, part.colour, texture, clear=False))
    return written


def surface_node_name(number: int, part: Surface) -> str:
    """Name of a surface's node."""
    return f"n{number}_{part.name}"


def _jpeg(picture: UInt8[np.ndarray, "h w 3"]) -> bytes:
    bgr = np.ascontiguousarray(picture[..., ::-1])
    return cv2.imencode(".jpg", bgr, [cv2.IMWRITE_JPEG_QUALITY, QUALITY])[1].tobytes()
