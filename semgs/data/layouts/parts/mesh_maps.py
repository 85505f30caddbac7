"""Labels and depth of a frame from the mesh of its scene, by ray casting.

What a camera sees is kept on disk: a training draws scenes at random, and would read a mesh for nearly every sample.
"""

from __future__ import annotations

import hashlib
import io
import warnings
import zlib
from collections.abc import Hashable
from dataclasses import dataclass
from functools import cache, lru_cache
from pathlib import Path
from typing import ClassVar, Protocol, final, runtime_checkable
from zipfile import BadZipFile

import numpy as np
from jaxtyping import Bool, Float32, Num, UInt8, UInt16

from semgs.data.maps import Pixels
from semgs.data.raycast import Raycaster
from semgs.data.tables.classes import IGNORE
from semgs.files.atomic import write_bytes
from semgs.files.paths import cache_folder
from semgs.geometry.cameras import Cameras

KEPT = "casts"
"""The folder in the cache; every scene has its own folder in it."""
FORM = 1
"""Version of the cached files; increase it if the same input gives other results."""

MILLIMETRES = 1000
FARTHEST = 65.535
"""Depth has whole millimetres in 16 bits; beyond this it is unknown [m]."""
AT_ONCE = 1 << 18
"""Rays that are cast at once: some tens of megabytes."""


@runtime_checkable
class StoredMesh(Hashable, Protocol):
    """A labelled mesh in files that are read where a camera looks that has not looked before."""

    @property
    def kept_in(self) -> str:
        """The name of the scene's folder in the cache."""

    def key(self) -> tuple:
        """What the labels and depths depend on besides the camera; it changes when a file of the mesh does."""

    def triangles(self) -> LabelledTriangles:
        """The mesh, ready for rays.

        Raises:
            InputError: a file of the scene cannot be used.
            ImportError: a library for ray casting is not installed; the error names the extra to install.
        """


def cast_from(mesh: StoredMesh, camera: Cameras) -> tuple[UInt8[np.ndarray, "h w"], Float32[np.ndarray, "h w"]]:
    """What a pinhole sees at its pixel centres: labels, 255 = none, and z-depths [m] in whole millimetres, 0 = none.

    Raises:
        InputError, ImportError: as `StoredMesh.triangles`.
    """
    pose, intrinsics = camera.world_from_camera.numpy().tobytes(), camera.intrinsics.numpy().tobytes()
    digest = hashlib.sha256(repr((FORM, *mesh.key(), camera.size)).encode())
    digest.update(pose)
    digest.update(intrinsics)
    place = cache_folder() / KEPT / mesh.kept_in / f"{digest.hexdigest()[:32]}.npz"
    labels, counts = _seen(mesh, place, pose, intrinsics, camera.size)
    return labels.copy(), metres(counts)


@final
@dataclass(frozen=True)
class MeshLabels:
    """Labels from a mesh.

    Attributes:
        mesh: of the scene.
    """

    mesh: StoredMesh
    stored: ClassVar[bool] = False

    def read(self, pixels: Pixels) -> UInt8[np.ndarray, "h w"]:
        """As `MapSource.read`, exact at the centres of the pixels.

        Raises:
            InputError, ImportError: as `StoredMesh.triangles`.
        """
        return cast_from(self.mesh, pixels.camera)[0]


@final
@dataclass(frozen=True)
class MeshDepth:
    """Z-depths from a mesh.

    Attributes:
        mesh: of the scene.
    """

    mesh: StoredMesh
    stored: ClassVar[bool] = False

    def read(self, pixels: Pixels) -> Float32[np.ndarray, "h w"]:
        """As `MapSource.read`, exact at the centres of the pixels.

        Raises:
            InputError, ImportError: as `StoredMesh.triangles`.
        """
        return cast_from(self.mesh, pixels.camera)[1]


@lru_cache(maxsize=1)
def _seen(
    mesh: StoredMesh, place: Path, pose: bytes, intrinsics: bytes, size: tuple[int, int]
) -> tuple[UInt8[np.ndarray, "h w"], UInt16[np.ndarray, "h w"]]:
    """Labels and z-depths [mm] that a camera sees. The last result stays in memory, because both are read one after the other.

    Args:
        mesh: of the scene.
        place: the cache file.
        pose: the bytes of the pose.
        intrinsics: the bytes of K.
        size: (height, width) [px].
    """
    found = _kept(place, size)
    if found is None:
        found = mesh.triangles().cast(np.frombuffer(pose).reshape(4, 4), np.frombuffer(intrinsics).reshape(3, 3), size)
        _keep(place, *found)
    return found


def _kept(path: Path, size: tuple[int, int]) -> tuple[UInt8[np.ndarray, "h w"], UInt16[np.ndarray, "h w"]] | None:
    """The cached result, None if there is none or it is damaged."""
    try:
        with np.load(io.BytesIO(path.read_bytes()), allow_pickle=False) as held:
            labels, counts = held["labels"], held["millimetres"]
    except (OSError, ValueError, KeyError, EOFError, BadZipFile, zlib.error):
        return None
    fits = labels.shape == counts.shape == size and (labels.dtype, counts.dtype) == (np.uint8, np.uint16)
    return (labels, counts) if fits else None


def _keep(path: Path, labels: UInt8[np.ndarray, "h w"], counts: UInt16[np.ndarray, "h w"]) -> None:
    """Cache a result; if that fails, warn once."""
    file = io.BytesIO()
    np.savez_compressed(file, labels=labels, millimetres=counts)
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        write_bytes(path, file.getvalue())
    except OSError as error:
        _say_once(str(path.parent.parent), error.strerror or str(error))


@cache
def _say_once(folder: str, reason: str) -> None:
    """Warn that results are not cached."""
    warnings.warn(
        f"labels and depth from meshes cannot be cached in {folder} ({reason}) and are computed each time; "
        "set SEMGS_CACHE to another folder",
        stacklevel=2,
    )


@final
@dataclass(frozen=True, eq=False)
class LabelledTriangles:
    """A labelled mesh prepared for ray casting.

    Attributes:
        caster: its triangles.
        labels: of each triangle, 255 = none.
        hidden: whether to ignore a triangle, including its depth.
    """

    caster: Raycaster
    labels: UInt8[np.ndarray, " m"]
    hidden: Bool[np.ndarray, " m"]

    def cast(
        self, world_from_camera: Num[np.ndarray, "4 4"], intrinsics: Num[np.ndarray, "3 3"], size: tuple[int, int]
    ) -> tuple[UInt8[np.ndarray, "h w"], UInt16[np.ndarray, "h w"]]:
        """Labels and z-depths [mm] at the pixel centres of a pinhole."""
        height, width = size
        labels, counts = np.empty(height * width, np.uint8), np.empty(height * width, np.uint16)
        turned = (world_from_camera[:3, :3] @ np.linalg.inv(intrinsics)).T
        for start in range(0, height * width, AT_ONCE):
            row, column = np.divmod(np.arange(start, min(start + AT_ONCE, height * width)), width)
            rays = np.stack((column + 0.5, row + 0.5, np.ones(len(row))), axis=-1) @ turned
            # For a direction with z = 1 in the camera, the distance is the z-depth.
            triangles, depths = self.caster.cast(np.broadcast_to(world_from_camera[:3, 3], rays.shape), rays)
            seen = (triangles >= 0) & ~self.hidden[triangles]
            labels[start : start + len(row)] = np.where(seen, self.labels[triangles], IGNORE)
            near = seen & (depths <= FARTHEST)
            counts[start : start + len(row)] = np.round(np.where(near, depths, 0).astype(np.float64) * MILLIMETRES)
        return labels.reshape(size), counts.reshape(size)


def metres(counts: UInt16[np.ndarray, "h w"]) -> Float32[np.ndarray, "h w"]:
    """Depths [m] of depths in whole millimetres."""
    return counts.astype(np.float32) / np.float32(MILLIMETRES)
