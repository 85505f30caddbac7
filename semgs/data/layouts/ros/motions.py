"""Motions of ROS frames: the pose of one frame in another at any time, interpolated between recorded transforms.

A transform from parent to child is the pose of the child in the parent: a point p of the child is at R p + t in the parent. Camera frames are
optical: x right, y down, z forward (REP 103), like ours. Like tf2, rotations are interpolated spherically and positions linearly. There is
no pose before the first, after the last, and in long gaps.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

LONGEST_GAP = 1_000_000_000
"""No interpolation between poses further apart than this [ns]."""


@dataclass(frozen=True, eq=False)
class Motion:
    """How a frame moves in another.

    Attributes:
        parent: the frame in which poses are given.
        child: the frame that moves.
        times: ascending, without duplicates [ns]; empty if it never moves.
        positions: of the child in the parent [n 3] [m]; one if it never moves.
        quaternions: (x, y, z, w) [n 4].
        source: the topic of the poses.
        broken: how many poses of the topic are left out, as they have a number that is not finite or a quaternion of zero.
    """

    parent: str
    child: str
    times: np.ndarray
    positions: np.ndarray
    quaternions: np.ndarray
    source: str
    broken: int = 0

    @property
    def fixed(self) -> bool:
        """Whether it never moves."""
        return len(self.times) == 0

    def at(self, times: np.ndarray) -> np.ndarray:
        """Parent from child at some times [ns], [n 4 4]; NaN where unknown."""
        from scipy.spatial.transform import Rotation, Slerp  # takes a second to import, only for bags

        poses = np.zeros((len(times), 4, 4))
        poses[:, 3, 3] = 1
        if self.fixed:
            poses[:, :3, :3] = Rotation.from_quat(self.quaternions[0]).as_matrix()
            poses[:, :3, 3] = self.positions[0]
            return poses
        after = np.searchsorted(self.times, times, side="left").clip(0, len(self.times) - 1)
        exact = self.times[after] == times
        before = np.where(exact, after, (after - 1).clip(0))
        span = self.times[after] - self.times[before]
        known = exact | ((self.times[before] <= times) & (times <= self.times[after]) & (span <= LONGEST_GAP))
        share = np.where(span > 0, (times - self.times[before]) / np.maximum(span, 1), 0.0)[:, None]
        poses[:, :3, 3] = (1 - share) * self.positions[before] + share * self.positions[after]
        seconds = (self.times - self.times[0]) / 1e9
        if len(seconds) > 1:
            wanted = ((times - self.times[0]) / 1e9).clip(0, seconds[-1])
            poses[:, :3, :3] = Slerp(seconds, Rotation.from_quat(self.quaternions))(wanted).as_matrix()
        else:
            poses[:, :3, :3] = Rotation.from_quat(self.quaternions[0]).as_matrix()
        poses[~known] = np.nan
        return poses


def make_motion(
    parent: str, child: str, samples: Mapping[int, tuple[np.ndarray, np.ndarray]], source: str, *, fixed: bool = False
) -> Motion | None:
    """The motion from samples, position [3] and quaternion [4] by time [ns]; None if no sample is a pose.

    Args:
        parent: the frame in which poses are given, perhaps with ROS 1's leading slash.
        child: the frame that moves, likewise.
        samples: by time.
        source: the topic.
        fixed: whether it never moves; then the last sample is used.
    """
    times = [time for time, (place, turn) in sorted(samples.items()) if _is_pose(place, turn)]
    if not times:
        return None
    kept = times[-1:] if fixed else times
    return Motion(
        parent.lstrip("/"),
        child.lstrip("/"),
        np.array([] if fixed else times, dtype=np.int64),
        np.stack([samples[time][0] for time in kept]),
        np.stack([samples[time][1] for time in kept]),
        source,
        len(samples) - len(times),
    )


def motions_above(motions: Mapping[str, Motion], frame: str) -> list[Motion]:
    """The motions from a frame up to the root of its tree, nearest first.

    Args:
        motions: by child.
        frame: where to start.
    """
    found: list[Motion] = []
    seen = {frame}
    while frame in motions and motions[frame].parent not in seen:
        found.append(motions[frame])
        frame = motions[frame].parent
        seen.add(frame)
    return found


def poses_along(path: list[Motion], times: np.ndarray) -> np.ndarray:
    """The pose of a path's first frame in its last frame, at some times [ns], [n 4 4]; NaN where unknown."""
    poses = np.broadcast_to(np.eye(4), (len(times), 4, 4))
    for step in path:
        poses = step.at(times) @ poses
    return poses


def _is_pose(place: np.ndarray, turn: np.ndarray) -> bool:
    """Whether all numbers are finite and the quaternion is not zero."""
    return bool(np.isfinite(place).all() and np.isfinite(turn).all() and np.linalg.norm(turn) > 1e-6)
