"""A labelled mesh that rays are cast at."""

from __future__ import annotations

from dataclasses import dataclass
from typing import final

import numpy as np
from jaxtyping import Bool, Float32, Num, UInt8, UInt16

from semgs.data.raycast import Raycaster
from semgs.data.tables.classes import IGNORE

MILLIMETRES = 1000
FARTHEST = 65.535
"""Depth has whole millimetres in 16 bits; beyond this it is unknown [m]."""
AT_ONCE = 1 << 18
"""Rays that are cast at once: some tens of megabytes."""


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
