"""Checks of poses from files; errors name the place in the file."""

from __future__ import annotations

from collections.abc import Sequence
from contextlib import suppress

import numpy as np
import torch

from semgs.data.layouts.parts.fields import Fields
from semgs.files.errors import InputError
from semgs.files.stored import Stored
from semgs.geometry.cameras import ROTATION_TOLERANCE
from semgs.geometry.rotations import nearest_rotation, why_no_rotation

FURTHEST = 1e12
"""Largest coordinate of a position [the scene's unit]; beyond, float64 cannot resolve millimetres."""

EXPECTED = "a 4x4 camera-to-world matrix [R t; 0 0 0 1] of finite numbers, R a rotation"


def checked_poses(
    path: Stored, matrices: Sequence[object], keys: Sequence[str], expected: str = EXPECTED
) -> np.ndarray:
    """Matrices as rigid motions, float64 [n 4 4]; near-rotations are orthonormalised.

    Args:
        path: the file that they are from.
        matrices: nested lists or arrays, one per frame, as found in the file.
        keys: the place of each in the file.
        expected: what they should be, for the error.

    Raises:
        InputError: one is not a 4x4 matrix of finite numbers, is far from a rigid motion, or further away than `FURTHEST`; the error
            names its key.
    """
    poses = _array(path, matrices, keys, expected)
    finite = np.isfinite(poses).all(axis=(1, 2))
    if not finite.all():
        raise _refused(path, keys[int(np.argmin(finite))], "a number that is not finite", expected)
    last = np.abs(poses[:, 3] - (0, 0, 0, 1)).max(axis=1)
    if (last > 1e-6).any():
        index = int(np.argmax(last > 1e-6))
        raise _refused(path, keys[index], f"a last row of {poses[index, 3].tolist()}", expected)
    away = np.abs(poses[:, :3, 3]).max(axis=1)
    if (away > FURTHEST).any():
        index = int(np.argmax(away))
        raise _refused(
            path,
            keys[index],
            f"a position {away[index]:.3g} from the origin; at most {FURTHEST:g} is allowed",
            expected,
        )
    rotations = nearest_rotation(torch.from_numpy(poses[:, :3, :3])).numpy()
    off = np.abs(rotations - poses[:, :3, :3]).max(axis=(1, 2))
    if (off > ROTATION_TOLERANCE).any():
        index = int(np.argmax(off > ROTATION_TOLERANCE))
        determinant = float(np.linalg.det(poses[index, :3, :3]))
        kind, advice = why_no_rotation(torch.from_numpy(poses[index, :3, :3]))
        found = f"a 3x3 part with determinant {determinant:.4g} that is not a rotation ({kind})"
        raise _refused(path, keys[index], found, expected, advice)
    poses[:, :3, :3] = rotations
    return poses


def pose_is_lost(frame: Fields) -> bool:
    """Whether the `transform_matrix` of a frame of a `transforms.json` has a number that is not finite, as if tracking was lost."""
    matrix = frame.values.get("transform_matrix")
    with suppress(TypeError, ValueError, OverflowError):
        return isinstance(matrix, list) and not np.isfinite(np.array(matrix, dtype=np.float64)).all()
    return False


def listed_poses(frames: Sequence[Fields]) -> np.ndarray:
    """The `transform_matrix` of each frame of a `transforms.json` as a rigid motion, float64 [n 4 4].

    Raises:
        InputError: as `checked_poses`.
    """
    key = "transform_matrix"
    places = [f"{frame.place}{key}" for frame in frames]
    return checked_poses(frames[0].path, [frame.values.get(key) for frame in frames], places)


def _array(path: Stored, matrices: Sequence[object], keys: Sequence[str], expected: str) -> np.ndarray:
    """The matrices as float64 [n 4 4]."""
    poses = np.empty((len(matrices), 4, 4))
    for index, matrix in enumerate(matrices):
        if matrix is None:
            raise _refused(path, keys[index], "nothing", expected)
        try:
            numbers = np.array(matrix, dtype=np.float64)
        except (TypeError, ValueError, OverflowError):
            raise _refused(path, keys[index], "something that is not a matrix of numbers", expected) from None
        if numbers.shape != (4, 4):
            raise _refused(path, keys[index], f"an array of shape {numbers.shape}", expected)
        poses[index] = numbers
    return poses


def _refused(path: Stored, key: str, found: str, expected: str, advice: str | None = None) -> InputError:
    """The error for one pose."""
    return InputError(path, expected, found, key, advice)
