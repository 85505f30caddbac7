"""Poses in text files: all in one file, in several forms, or one file per frame. All are camera to world.

8 numbers per line    time, tx ty tz, qx qy qz qw: TUM RGB-D and most SLAM systems
7 numbers per line    the same without the time
16 or 12 per line     a row-major 4x4 or 3x4 matrix: Replica's, KITTI's, ICL's
3, then 4 lines of 4  Redwood's .log: three integers and a 4x4 matrix
lines of 4            4x4 or 3x4 matrices below each other: SUN3D's

If a comment names the columns of positions and quaternions, they are read by their names, in any order.

Entries of two streams are associated by time, as in TUM RGB-D's own tool.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from semgs.data.layouts.parts.text_numbers import pose_columns, read_rows, times_per_second
from semgs.files.errors import InputError
from semgs.files.stored import Stored

FORMS = "poses as 8 numbers per line (time, tx ty tz, qx qy qz qw) or the last 7 of them, as 4x4 or 3x4 matrices, or as Redwood's .log"

UNIT_TOLERANCE = 0.1
"""Quaternions may differ from unit length by this much."""

TOLERANCE = 0.02
"""Largest time difference of associated entries [s]: TUM RGB-D's default."""


NEAREST = 25
"""So many entries before one, and so many after it, are looked at: a stream that has more within the tolerance is no stream of images or poses."""

MILLISECONDS, MICROSECONDS, NANOSECONDS = 1e11, 1e14, 1e17
"""Times of the clock that are larger than these are in that unit: in seconds, the first is in the year 5138."""


@dataclass(frozen=True, eq=False)
class FoundPose:
    """A pose and where it is from.

    Attributes:
        matrix: world from camera [4 4], not checked; NaN if tracking was lost.
        path: the file.
        place: the place in it ("line 3"), or empty if it contains nothing else.
    """

    matrix: np.ndarray
    path: Stored
    place: str = ""

    @property
    def finite(self) -> bool:
        """Whether tracking was not lost."""
        return bool(np.isfinite(self.matrix).all())


@dataclass(frozen=True, eq=False)
class Trajectory:
    """The poses in a file.

    Attributes:
        path: the file.
        poses: world from camera [n 4 4], not checked; NaN if tracking was lost.
        places: of each in the file ("line 3").
        times: of each [s]; None if the file has none.
        ids: of the frame of each; None if the file has none.
    """

    path: Path
    poses: np.ndarray
    places: tuple[str, ...]
    times: np.ndarray | None = None
    ids: tuple[int, ...] | None = None

    def __len__(self) -> int:
        return len(self.poses)

    def at(self, index: int | None) -> FoundPose | None:
        """A pose by its position; None if there is none."""
        if index is None or index >= len(self):
            return None
        return FoundPose(self.poses[index], self.path, self.places[index])


def read_trajectory(path: Path) -> Trajectory:
    """The poses in a text file, in any of the forms above.

    Raises:
        InputError: it cannot be read, is empty, or has another form; the error names the line.
    """
    held = read_rows(path)
    if not held:
        raise InputError(path, FORMS, "no line with numbers")
    lengths = [len(values) for _, values in held]
    places = [f"line {number}" for number, _ in held]
    columns = pose_columns(path, lengths[0]) if len(set(lengths)) == 1 else None
    if columns is not None:
        table = np.array([values for _, values in held])
        poses = poses_of_rows(path, table[:, columns.pose], places)
        times = None if columns.time is None else in_seconds(table[:, columns.time], times_per_second(path))
        ids = None if columns.id is None else tuple(map(int, np.nan_to_num(table[:, columns.id], nan=-1)))
        return Trajectory(path, poses, tuple(places), times, ids)
    if set(lengths) in ({16}, {12}):
        return Trajectory(path, np.stack([_as_motion(values) for _, values in held]), tuple(places))
    step = 5 if lengths[:5] == [3, 4, 4, 4, 4] else _rows_of_a_matrix([values for _, values in held], lengths)
    wanted = [3, 4, 4, 4, 4] if step == 5 else [4] * max(step, 1)
    if step and len(held) % step == 0 and lengths == wanted * (len(held) // step):
        starts = range(0, len(held), step)
        parts = [
            [value for _, values in held[start + (step == 5) : start + step] for value in values] for start in starts
        ]
        return Trajectory(
            path, np.stack([_as_motion(part) for part in parts]), tuple(places[start] for start in starts)
        )
    odd = next((index for index, length in enumerate(lengths) if length != lengths[0]), 0)
    raise InputError(path, FORMS, f"{lengths[odd]} numbers", places[odd])


def read_pose(path: Path) -> FoundPose:
    """The pose in the text file of a frame: a 4x4 or 3x4 matrix, or tx ty tz, qx qy qz qw. NaN if tracking was lost.

    Raises:
        InputError: it cannot be read, or contains something else.
    """
    held = read_rows(path)
    flat = [value for _, values in held for value in values]
    columns = pose_columns(path, len(flat)) if len(held) == 1 else None
    if columns is not None:
        return FoundPose(poses_of_rows(path, np.array([flat])[:, columns.pose], [f"line {held[0][0]}"])[0], path)
    if len(flat) not in (12, 16) or (len(held) > 1 and any(len(values) != 4 for _, values in held)):
        found = f"{len(held)} lines of {sorted({len(values) for _, values in held})} numbers" if held else "nothing"
        raise InputError(path, "a camera-to-world matrix of 4x4 or 3x4 numbers, or tx ty tz, qx qy qz qw", found)
    return FoundPose(_as_motion(flat), path)


def _as_motion(flat: list[float]) -> np.ndarray:
    """The 4x4 matrix of 16 numbers, or of the 12 of its first three rows."""
    return np.array([*flat, 0.0, 0.0, 0.0, 1.0][:16] if len(flat) == 12 else flat, dtype=np.float64).reshape(4, 4)


def poses_of_rows(path: Stored, table: np.ndarray, places: Sequence[str]) -> np.ndarray:
    """Matrices [n 4 4] from rows tx ty tz, qx qy qz qw [n 7]; NaN for a zero or NaN quaternion, which means no pose.

    Args:
        path: the file that they are from.
        table: the rows.
        places: of each in the file.

    Raises:
        InputError: a quaternion is far from unit length.
    """
    norms = np.linalg.norm(table[:, 3:], axis=1)
    off = (np.abs(norms - 1) > UNIT_TOLERANCE) & (norms > 1e-6)
    if off.any():
        index = int(np.argmax(off))
        found = f"{table[index, 3:].tolist()} of length {norms[index]:.3g}"
        raise InputError(path, "a unit quaternion qx qy qz qw", found, places[index])
    return poses_from_quaternions(table[:, :3], table[:, 3:])


def poses_from_quaternions(positions: np.ndarray, quaternions: np.ndarray) -> np.ndarray:
    """Matrices [n 4 4] from positions [n 3] and quaternions [n 4] (x, y, z, w); NaN for a zero quaternion."""
    lengths = np.linalg.norm(quaternions, axis=1, keepdims=True)
    with np.errstate(divide="ignore", invalid="ignore"):
        x, y, z, w = np.where(lengths > 1e-6, quaternions / lengths, np.nan).T
    poses = np.zeros((len(positions), 4, 4))
    poses[:, 0, :3] = np.stack((1 - 2 * (y * y + z * z), 2 * (x * y - z * w), 2 * (x * z + y * w)), axis=1)
    poses[:, 1, :3] = np.stack((2 * (x * y + z * w), 1 - 2 * (x * x + z * z), 2 * (y * z - x * w)), axis=1)
    poses[:, 2, :3] = np.stack((2 * (x * z - y * w), 2 * (y * z + x * w), 1 - 2 * (x * x + y * y)), axis=1)
    poses[:, :3, 3] = positions
    poses[:, 3, 3] = 1
    return poses


def _rows_of_a_matrix(held: list[list[float]], lengths: list[int]) -> int:
    """How many lines of 4 numbers make a matrix: 4 if every fourth is 0 0 0 1, else 3; 0 if lines have another length."""
    if set(lengths) != {4}:
        return 0
    return 4 if all(values == [0, 0, 0, 1] for values in held[3::4]) and len(held) % 4 == 0 else 3


def in_seconds(times: np.ndarray, per_second: float | None = None) -> np.ndarray:
    """Times [n] in seconds.

    Args:
        times: in any unit.
        per_second: how many units are a second; None if unknown: then they are of the clock, in seconds, milliseconds, microseconds or nanoseconds since 1970.
    """
    if per_second is not None:
        return times / per_second
    known = np.abs(times[np.isfinite(times)])
    largest = float(known.max()) if len(known) else 0.0
    units = ((NANOSECONDS, 1e9), (MICROSECONDS, 1e6), (MILLISECONDS, 1e3))
    return times / next((per_second for least, per_second in units if largest >= least), 1.0)


def associate(first: np.ndarray, second: np.ndarray, tolerance: float = TOLERANCE) -> dict[int, int]:
    """For entries of the first stream, the entry of the second at nearly the same time. Nearest pairs first; each entry is used once.

    Args:
        first: times [n] in any order [s].
        second: times [m] [s].
        tolerance: pairs are less than this apart [s].

    Returns:
        Positions in the second by positions in the first, in the order of the first. Entries without a partner are left out.
    """
    order = np.argsort(second, kind="stable")
    middles = np.searchsorted(second[order], first)
    begins = np.maximum(np.searchsorted(second[order], first - tolerance, side="left"), middles - NEAREST)
    ends = np.minimum(np.searchsorted(second[order], first + tolerance, side="right"), middles + NEAREST)
    pairs = sorted(
        (abs(first[i] - second[j]), i, int(j))
        for i in range(len(first))
        for j in order[begins[i] : ends[i]]
        if abs(first[i] - second[j]) < tolerance
    )
    found: dict[int, int] = {}
    used: set[int] = set()
    for _, i, j in pairs:
        if i not in found and j not in used:
            found[i] = j
            used.add(j)
    return dict(sorted(found.items()))
