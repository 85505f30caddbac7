"""Covisibility: how much of what one frame sees is also seen by other frames.

Each image is divided into `GRID` x `GRID` cells. The centre of each cell is placed in the world by its z-depth, which comes from the
frame's depth map, from the scene's sparse points, or, if there is neither, is one assumed depth for all.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import torch

from semgs.data.frames import Frame
from semgs.data.scene import Scene
from semgs.files.errors import InputError
from semgs.geometry.cameras import Cameras

GRID = 10
FEWEST_CELLS = 10
"""Depth maps with fewer known cells, and fewer sparse points than this, are not used."""

WIDEST_ANGLE = np.radians(60)
"""A surface seen from directions further apart than this does not look the same."""

HIDDEN = 1.1
"""A point is hidden from a frame if it is farther than this times the largest depth that the frame measured in that cell."""


@dataclass(frozen=True, eq=False)
class DepthGrid:
    """The depths that one frame sees, on a grid of cells.

    Attributes:
        depths: z-depth at the centre of each cell, row by row [cell]; NaN if unknown [m, or the scene's unit].
        farthest: the largest measured depth in each cell [cell]; infinite if none.
        source: where the depths are from: "measured depth", "sparse points", or "" for an assumed depth.
    """

    depths: np.ndarray
    farthest: np.ndarray
    source: str = ""

    @property
    def median(self) -> float:
        """The median of the known depths."""
        return float(np.nanmedian(self.depths))


def flat_grid(depth: float) -> DepthGrid:
    """The grid of a frame without any depth: every cell at one assumed depth."""
    return DepthGrid(np.full(GRID * GRID, depth), np.full(GRID * GRID, np.inf))


class DepthGrids:
    """The depth grids of a scene's frames, computed on first use."""

    def __init__(self, scene: Scene) -> None:
        self._scene = scene
        self._found: dict[int, DepthGrid | None] = {}
        self.measured = any(frame.depth is not None for frame in scene.frames)
        """Whether depth maps have to be read, which takes milliseconds a frame."""

    def of(self, indices: Sequence[int] | np.ndarray, otherwise: float) -> list[DepthGrid]:
        """The grids of some frames; frames without depth get the depth `otherwise`."""
        return [self._grid(int(index)) or flat_grid(otherwise) for index in indices]

    def _grid(self, index: int) -> DepthGrid | None:
        """The grid of a frame, None if its depth is unknown."""
        if index not in self._found:
            frame, points = self._scene.frames[index], self._scene.points
            grid = _from_depth_map(frame)
            if grid is None and points is not None:
                grid = _from_points(frame, points)
            self._found[index] = grid
        return self._found[index]


def _from_depth_map(frame: Frame) -> DepthGrid | None:
    """The grid from a frame's depth map, None if there is none or it is nearly empty."""
    try:
        depths = frame.measured()
    except InputError:
        return None  # harmless unless the frame is used, and then reading it reports the error
    return None if depths is None else grid_of(depths, "measured depth")


def grid_of(depths: np.ndarray, source: str) -> DepthGrid | None:
    """The grid from a depth map [h w], 0 where unknown; None if it is nearly empty."""
    height, width = depths.shape
    row, column = ((2 * np.arange(GRID) + 1) * side // (2 * GRID) for side in (height, width))
    middles = depths[row[:, None], column].astype(np.float64).ravel()
    if np.count_nonzero(middles) < FEWEST_CELLS:
        return None
    above, left = (np.arange(GRID) * side // GRID for side in (height, width))
    farthest = np.maximum.reduceat(np.maximum.reduceat(depths, above, axis=0), left, axis=1).astype(np.float64).ravel()
    return DepthGrid(np.where(middles > 0, middles, np.nan), np.where(farthest > 0, farthest, np.inf), source)


def _from_points(frame: Frame, points: np.ndarray) -> DepthGrid | None:
    """The grid from sparse points: each cell takes the depth of the point nearest to its centre. None if the frame sees too few."""
    ours = points if frame.points is None else points[frame.points]
    pose, (height, width) = frame.world_from_camera, frame.lens.size
    seen = (ours - pose[:3, 3]) @ pose[:3, :3]
    seen = seen[seen[:, 2] > 0]
    places = (seen @ frame.lens.intrinsics.T)[:, :2] / seen[:, 2:] / (width, height)
    inside = ((places >= 0) & (places < 1)).all(axis=1)
    places, depths = places[inside], seen[inside, 2]
    if len(depths) < FEWEST_CELLS:
        return None
    distances = np.linalg.norm((_middles()[:, None] - places) * (width, height), axis=-1)
    return DepthGrid(depths[distances.argmin(axis=1)], np.full(GRID * GRID, np.inf), "sparse points")


def _middles() -> np.ndarray:
    """(x, y) of the centre of each cell, row by row, relative to the image's width and height [cell 2]."""
    steps = (np.arange(GRID) + 0.5) / GRID
    return np.stack(np.meshgrid(steps, steps), axis=-1).reshape(-1, 2)


def world_points(grid: DepthGrid, camera: Cameras) -> np.ndarray:
    """The known points of a grid in the world [n 3]."""
    height, width = camera.size
    pose, pixels = camera.world_from_camera.numpy(), _middles() * (width, height)
    rays = np.column_stack((pixels, np.ones(len(pixels)))) @ np.linalg.inv(camera.intrinsics.numpy()).T
    points = (rays * grid.depths[:, None]) @ pose[:3, :3].T + pose[:3, 3]
    return points[np.isfinite(grid.depths)]


class Covisibility:
    """What cameras see of one another's surfaces. The cameras may have different sizes.

    Args:
        cameras: each without leading axes.
        grids: the depths that each sees.

    Attributes:
        medians: the median depth of each frame [n].
        baselines: distances between the cameras [n n].
    """

    def __init__(self, cameras: Sequence[Cameras], grids: Sequence[DepthGrid]) -> None:
        poses = np.stack([camera.world_from_camera.numpy() for camera in cameras])
        intrinsics = np.stack([camera.intrinsics.numpy() for camera in cameras])
        depths = np.stack([grid.depths for grid in grids])
        rotations, self._centres = poses[:, :3, :3], poses[:, :3, 3]
        self._sizes = np.array([camera.size[::-1] for camera in cameras], dtype=np.float64)
        self._projections = intrinsics @ rotations.mT
        grid = _middles() * self._sizes[:, None]
        pixels = np.concatenate((grid, np.ones_like(grid[..., :1])), axis=-1)
        rays = depths[..., None] * pixels @ np.linalg.inv(self._projections).mT
        self._points = self._centres[:, None] + rays
        self._directions = rays / np.linalg.norm(rays, axis=-1, keepdims=True)
        self._known = np.isfinite(depths).sum(axis=1)
        self._farthest = np.stack([grid.farthest for grid in grids])
        self.medians = np.array([grid.median for grid in grids])
        self.baselines = np.linalg.norm(self._centres[:, None] - self._centres, axis=-1)
        self._seen = np.stack([self._seen_by(index) for index in range(len(poses))])

    @classmethod
    def of(cls, scene: Scene, indices: Sequence[int] | np.ndarray, grids: Sequence[DepthGrid]) -> Covisibility:
        """The covisibility of some frames of a scene, given their depth grids."""
        frames = [scene.frames[index] for index in indices]
        intrinsics = {frame.lens: torch.from_numpy(frame.lens.intrinsics) for frame in frames}
        poses = [torch.from_numpy(frame.world_from_camera) for frame in frames]
        cameras = [
            Cameras.trusted(pose, intrinsics[frame.lens], frame.lens.size)
            for pose, frame in zip(poses, frames, strict=True)
        ]
        return cls(cameras, grids)

    @property
    def relative_baselines(self) -> np.ndarray:
        """Distances between the cameras, divided by the geometric mean of their two median depths [n n]."""
        return self.baselines / np.sqrt(self.medians[:, None] * self.medians)

    def overlaps(self) -> np.ndarray:
        """The share of what each pair sees in common, the smaller of both directions [n n]."""
        seen = self._seen.sum(axis=-1).T / self._known[:, None]
        return np.minimum(seen, seen.T)

    def covered(self, by: Sequence[int], times: int = 1) -> np.ndarray:
        """The share of what each frame sees that at least `times` of the frames `by` also see [n]."""
        return (self._seen[list(by)].sum(axis=0) >= times).sum(axis=-1) / self._known

    def _seen_by(self, index: int) -> np.ndarray:
        """Which cells of each frame one frame also sees: inside its image, from a similar direction, and not hidden [n cell]."""
        towards = self._points - self._centres[index]
        x, y, depth = np.moveaxis(towards @ self._projections[index].T, -1, 0)
        width, height = self._sizes[index]
        inside = (depth > 0) & (x >= 0) & (x < width * depth) & (y >= 0) & (y < height * depth)
        cosine = (towards * self._directions).sum(-1) / np.sqrt((towards * towards).sum(-1))
        seen = inside & (cosine > np.cos(WIDEST_ANGLE))
        if np.isfinite(self._farthest[index]).any():
            z = depth[seen]
            column, row = (
                (place[seen] / z * GRID / side).astype(np.int64) for place, side in ((x, width), (y, height))
            )
            cell = np.minimum(row, GRID - 1) * GRID + np.minimum(column, GRID - 1)
            seen[seen] = z <= HIDDEN * self._farthest[index, cell]
        return seen
