"""Whether predicted depth and cameras belong together: points of one photo, moved to the next, have to be at the depth that was predicted there.

Errors of the file, such as poses of the other direction or depth in millimetres, are found because the same numbers agree much better when they are
undone. Nothing is corrected: a guess could be wrong without a sign.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

PAIRS, SAMPLES = 12, 24
"""At most so many pairs of neighbouring photos, and points along each side of a photo, are compared."""

BETTER = 3.0
"""A mistake is reported if undoing it makes the median disagreement smaller by this factor."""

WRONG = 0.03
"""Nothing is reported below this median disagreement: networks err by as much, and a camera that hardly moves fits any unit."""

CLOSE = 0.15
"""What remains has to be below this, or undoing the mistake explains nothing."""

INVERSE = "inverse"
FLIP = np.diag([1.0, -1.0, -1.0, 1.0])


@dataclass(frozen=True)
class Mistake:
    """What a file looks like instead of what it should be.

    Attributes:
        name: "inverse" for poses of the other direction, or a sentence.
        stated: median disagreement of the depth as stored.
        undone: the same if the mistake is undone.
    """

    name: str
    stated: float
    undone: float


def find_mistake(world_from_camera: np.ndarray, intrinsics: np.ndarray, depth: np.ndarray) -> Mistake | None:
    """What the cameras and depths look like instead of what they should be; None if nothing explains them better.

    Args:
        world_from_camera: poses [n 4 4], OpenCV axes.
        intrinsics: [n 3 3].
        depth: [n h w], 0 where unknown.
    """
    stated = disagreement(world_from_camera, intrinsics, depth)
    inverse = np.linalg.inv(world_from_camera)
    alternatives = {
        INVERSE: (inverse, 1.0),
        "axes of OpenGL (y up, z backward)": (world_from_camera @ FLIP, 1.0),
        "depth in millimetres of poses in metres": (world_from_camera, 1e-3),
        "depth in metres of poses in millimetres": (world_from_camera, 1e3),
    }
    found = {name: disagreement(poses, intrinsics, depth * scale) for name, (poses, scale) in alternatives.items()}
    best = min(found, key=lambda name: found[name])
    return Mistake(best, stated, found[best]) if stated > WRONG and found[best] < min(CLOSE, stated / BETTER) else None


def disagreement(world_from_camera: np.ndarray, intrinsics: np.ndarray, depth: np.ndarray) -> float:
    """The median relative difference of depth between neighbouring photos; a point that is outside or behind the other differs by 1."""
    count, height, width = depth.shape
    rows = np.linspace(0, height - 1, min(SAMPLES, height)).astype(int)
    columns = np.linspace(0, width - 1, min(SAMPLES, width)).astype(int)
    grid = np.stack(np.meshgrid(columns + 0.5, rows + 0.5), axis=-1).reshape(-1, 2)
    differences = []
    for one in np.unique(np.linspace(0, count - 2, PAIRS).astype(int)):
        for source, target in ((one, one + 1), (one + 1, one)):
            known = depth[source][np.ix_(rows, columns)].reshape(-1).astype(np.float64)
            inside = np.column_stack((grid, np.ones(len(grid)))) @ np.linalg.inv(intrinsics[source]).T * known[:, None]
            inside = inside[known > 0]
            world = inside @ world_from_camera[source, :3, :3].T + world_from_camera[source, :3, 3]
            seen = (world - world_from_camera[target, :3, 3]) @ world_from_camera[target, :3, :3]
            differences.append(_differences(seen, intrinsics[target], depth[target]))
    joined = np.concatenate(differences)
    return float(np.median(joined)) if len(joined) else 0.0


def _differences(points: np.ndarray, intrinsics: np.ndarray, depth: np.ndarray) -> np.ndarray:
    """How far points [n 3] of a camera are from its depth map, relative to it. Points at unknown depth are left out."""
    height, width = depth.shape
    with np.errstate(divide="ignore", invalid="ignore", over="ignore"):
        places = points @ intrinsics.T
        column, row = (
            np.nan_to_num(places[:, axis] / points[:, 2], nan=-1.0).clip(-1, 1e9).astype(int) for axis in (0, 1)
        )
    visible = (points[:, 2] > 0) & (column >= 0) & (column < width) & (row >= 0) & (row < height)
    visible &= (places[:, 0] >= 0) & (places[:, 1] >= 0)
    met = depth[row[visible], column[visible]].astype(np.float64)
    known = met > 0
    off = np.abs(points[visible, 2][known] / met[known] - 1)
    return np.concatenate((np.minimum(off, 1.0), np.ones(int((~visible).sum()))))
