"""A small room of ours, seen by cameras of any kind: what the writers of other data sets' files write. It uses none of their readers."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cache

import numpy as np

from semgs.data.raycast import Raycaster
from semgs_rooms.pieces.solids import SHELL, gather, triangulate
from semgs_rooms.plans.worlds import furnish
from semgs_rooms.sets.room_stream import generator

SEED, INDEX = 5, 1
EYES = (
    (-1.6, -1.3, 1.5),
    (-1.3, -1.5, 1.4),
    (-1.0, -1.6, 1.55),
    (-0.7, -1.65, 1.45),
    (-0.3, -1.7, 1.5),
    (0.1, -1.7, 1.6),
)
AT = (0.6, 0.9, 0.9)


@dataclass(frozen=True)
class Photo:
    """What a camera sees.

    Attributes:
        colour: uint8 [h w 3].
        depth: z-depth [h w] in whole millimetres, uint16, 0 where nothing is.
        labels: of ScanNet's 20 classes [h w], 255 = none.
    """

    colour: np.ndarray
    depth: np.ndarray
    labels: np.ndarray


class Miniature:
    """The room: its triangles, each with the label of what it is part of."""

    def __init__(self) -> None:
        plan, _ = furnish(generator(SEED, INDEX), None, "home")
        solids = gather(plan.parts)
        assert (solids.shapes != SHELL).all(), "the room has parts with triangles of their own; choose another"
        self.corners, self.owners = triangulate(solids)
        self.labels = solids.labels[self.owners]
        self._caster = Raycaster(self.corners.reshape(-1, 3), np.arange(3 * len(self.corners)).reshape(-1, 3))

    def photograph(self, pose: np.ndarray, rays: np.ndarray) -> Photo:
        """The room along rays of the camera [h w 3], z = 1, from a pose (camera to world, OpenCV axes)."""
        size = rays.shape[:2]
        directions = rays.reshape(-1, 3) @ pose[:3, :3].T
        triangles, depths = self._caster.cast(np.broadcast_to(pose[:3, 3], directions.shape), directions)
        hit = triangles >= 0
        depths = np.where(hit, depths, 0).astype(np.float64)
        places = pose[:3, 3] + directions * depths[:, None]
        waves = np.array([[3.1, 1.2, 2.3], [-1.7, 2.9, 1.1], [1.9, -2.2, 2.7]])
        tint = np.stack([np.sin(1.7 * self.owners[triangles] + phase) for phase in (0, 2, 4)], axis=-1)
        colour = 130 + 60 * np.sin(places @ waves.T) + 40 * tint
        return Photo(
            np.where(hit[:, None], colour.clip(0, 255), 0).astype(np.uint8).reshape(*size, 3),
            np.round(1000 * depths).astype(np.uint16).reshape(size),
            np.where(hit, self.labels[triangles], 255).astype(np.uint8).reshape(size),
        )


@cache
def miniature() -> Miniature:
    """The room."""
    return Miniature()


def poses(count: int = len(EYES)) -> np.ndarray:
    """Camera to world [n 4 4], OpenCV axes, of cameras that look into the room."""
    found = []
    for index, eye in enumerate(EYES[:count]):
        forward = np.subtract(AT, eye) / np.linalg.norm(np.subtract(AT, eye))
        right = np.cross(forward, [0.0, 0.0, 1.0])
        right /= np.linalg.norm(right)
        down = np.cross(forward, right)
        roll = 0.05 * index - 0.1
        pose = np.eye(4)
        pose[:3] = np.stack(
            (np.cos(roll) * right + np.sin(roll) * down, np.cos(roll) * down - np.sin(roll) * right, forward, eye),
            axis=1,
        )
        found.append(pose)
    return np.array(found)


def pinhole_rays(size: tuple[int, int], k: np.ndarray, first: float) -> np.ndarray:
    """Rays [h w 3], z = 1, of the pixels of a pinhole K whose first pixel centre is at (first, first)."""
    rows, columns = np.mgrid[: size[0], : size[1]] + first
    return np.stack(((columns - k[0, 2]) / k[0, 0], (rows - k[1, 2]) / k[1, 1], np.ones(size)), axis=-1)
