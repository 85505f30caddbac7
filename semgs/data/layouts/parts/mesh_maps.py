"""Labels and depth of a frame from the mesh of its scene, by ray casting."""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar, Protocol, final, runtime_checkable

import numpy as np
from jaxtyping import Bool, Float32, Num, UInt8, UInt16

from semgs.data.classes import IGNORE
from semgs.data.maps import Pixels
from semgs.data.raycast import Raycaster
from semgs.geometry.cameras import Cameras

MILLIMETRES = 1000
FARTHEST = 65.535
"""Depth has whole millimetres in 16 bits; beyond this it is unknown [m]."""
AT_ONCE = 1 << 18
"""Rays that are cast at once: some tens of megabytes."""


@runtime_checkable
class SeenMesh(Protocol):
    """A labelled mesh."""

    def seen(self, camera: Cameras) -> tuple[UInt8[np.ndarray, "h w"], Float32[np.ndarray, "h w"]]:
        """What a pinhole sees at its pixel centres: labels, 255 = none, and z-depths [m], 0 = none.

        Raises:
            InputError: a file of the scene cannot be used.
            ImportError: a library for ray casting is not installed; the error names the extra to install.
        """


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

    def seen(self, camera: Cameras) -> tuple[UInt8[np.ndarray, "h w"], Float32[np.ndarray, "h w"]]:
        """As `SeenMesh.seen`, in whole millimetres."""
        labels, counts = self.cast(camera.world_from_camera.numpy(), camera.intrinsics.numpy(), camera.size)
        return labels, metres(counts)

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


@final
@dataclass(frozen=True)
class MeshLabels:
    """Labels from a mesh.

    Attributes:
        mesh: of the scene.
    """

    mesh: SeenMesh
    stored: ClassVar[bool] = False

    def read(self, pixels: Pixels) -> UInt8[np.ndarray, "h w"]:
        """As `MapSource.read`, exact at the centres of the pixels.

        Raises:
            InputError, ImportError: as `SeenMesh.seen`.
        """
        return self.mesh.seen(pixels.camera)[0]


@final
@dataclass(frozen=True)
class MeshDepth:
    """Z-depths from a mesh.

    Attributes:
        mesh: of the scene.
    """

    mesh: SeenMesh
    stored: ClassVar[bool] = False

    def read(self, pixels: Pixels) -> Float32[np.ndarray, "h w"]:
        """As `MapSource.read`, exact at the centres of the pixels.

        Raises:
            InputError, ImportError: as `SeenMesh.seen`.
        """
        return self.mesh.seen(pixels.camera)[1]
