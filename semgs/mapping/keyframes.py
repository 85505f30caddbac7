"""Keyframes: which frames of a recording are used, and with which earlier ones they form a window."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from semgs.data.choosing.choice import IDEAL_BASELINE, LEAST_SHARED, preference
from semgs.data.choosing.covisibility import GRID, WIDEST_ANGLE, Covisibility, DepthGrid, flat_grid, world_points
from semgs.geometry.cameras import Cameras

COVERED = 0.9
"""A frame is not needed if keyframes already see this share of what it sees."""

TIME_TO_ACT = 0.6
"""A frame without enough baseline waits for a later one as long as a keyframe sees this share of what it sees."""

NEIGHBOURS = 16
"""A frame is compared with this many keyframes: the nearest of those that look a similar way."""


@dataclass(frozen=True)
class Known:
    """A keyframe, as new frames are compared with it.

    Attributes:
        camera: of the keyframe.
        grid: the depths that it sees; None until it was part of a window.
    """

    camera: Cameras
    grid: DepthGrid | None


@dataclass(frozen=True)
class Verdict:
    """What to do with a frame.

    Attributes:
        use: whether it becomes a keyframe.
        partners: positions of the earlier keyframes that form a window with it, the best first; empty if none shares enough.
        covered: the share of what it sees that keyframes with Gaussians see, 0..1.
    """

    use: bool
    partners: tuple[int, ...]
    covered: float


def near(camera: Cameras, known: Sequence[Known]) -> list[int]:
    """Positions of the keyframes to compare a frame with, ascending: the nearest `NEIGHBOURS` of those that look a similar way."""
    if not known:
        return []
    poses = np.stack([one.camera.world_from_camera.numpy() for one in known])
    pose = camera.world_from_camera.numpy()
    alike = np.flatnonzero(poses[:, :3, 2] @ pose[:3, 2] > np.cos(WIDEST_ANGLE))
    distances = np.linalg.norm(poses[alike, :3, 3] - pose[:3, 3], axis=1)
    return sorted(alike[np.argsort(distances, kind="stable")[:NEIGHBOURS]].tolist())


def predict_depths(camera: Cameras, known: Sequence[Known], typical: float) -> DepthGrid:
    """The depths that a frame sees by what keyframes saw: of each cell the nearest point; cells without a point get the median of all.

    Args:
        camera: of the frame.
        known: keyframes.
        typical: the depth if they saw nothing of what it sees.
    """
    points = [world_points(one.grid, one.camera) for one in known if one.grid is not None]
    if not points:
        return flat_grid(typical)
    pose, (height, width) = camera.world_from_camera.numpy(), camera.size
    own = (np.concatenate(points) - pose[:3, 3]) @ pose[:3, :3]
    own = own[own[:, 2] > 0]
    places = own @ camera.intrinsics.numpy().T / own[:, 2:] * (GRID / width, GRID / height, 1)
    inside = ((places[:, :2] >= 0) & (places[:, :2] < GRID)).all(axis=1)
    if not inside.any():
        return flat_grid(typical)
    depths, places = own[inside, 2], places[inside].astype(np.int64)
    cells = np.full(GRID * GRID, np.inf)
    np.minimum.at(cells, places[:, 1] * GRID + places[:, 0], depths)
    return DepthGrid(np.where(np.isfinite(cells), cells, np.median(depths)), np.full(GRID * GRID, np.inf))


def judge_frame(camera: Cameras, known: Sequence[Known], partners: int, typical: float) -> Verdict:
    """Whether a frame becomes a keyframe, and its window.

    It does if keyframes see less than `COVERED` of what it sees. Partners share at least `LEAST_SHARED` with it, and go best with it by overlap and
    baseline, as in `semgs.data.choosing.choice`. If the baseline to the best one is shorter than the ideal, and it sees `TIME_TO_ACT` of the frame, a later frame will do
    better. A frame that shares too little with all of them becomes a keyframe without a window, and gets one with a later frame.

    Args:
        camera: of the frame.
        known: keyframes.
        partners: how many earlier keyframes a window has at most.
        typical: a depth that is assumed where nothing is known [m].
    """
    some = near(camera, known)
    if not some:
        return Verdict(True, (), 0.0)
    grid = predict_depths(camera, [known[index] for index in some], typical)
    grids = [grid, *(known[index].grid or flat_grid(grid.median) for index in some)]
    together = Covisibility([camera, *(known[index].camera for index in some)], grids)
    with_gaussians = [place for place, index in enumerate(some, 1) if known[index].grid is not None]
    covered = float(together.covered(with_gaussians)[0]) if with_gaussians else 0.0
    if covered >= COVERED:
        return Verdict(False, (), covered)
    overlaps = together.overlaps()[0, 1:]
    relative = together.relative_baselines[0, 1:]
    scores = np.where(overlaps >= LEAST_SHARED, overlaps * preference(relative), -1)
    order = [int(place) for place in np.argsort(-scores, kind="stable") if scores[place] >= 0][:partners]
    if not order:
        return Verdict(True, (), covered)
    waits = relative[order[0]] < IDEAL_BASELINE[0] and overlaps.max() >= TIME_TO_ACT
    return Verdict(not waits, () if waits else tuple(some[place] for place in order), covered)
