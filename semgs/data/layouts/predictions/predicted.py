"""What all tools predict from photos: cameras and depth at the processed size, with the checks that hold for all."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np

from semgs.data.layouts.parts.pose_files import checked_poses
from semgs.data.layouts.predictions.preprocessing import Plan, Size
from semgs.data.maps import FARTHEST
from semgs.files.errors import InputError

Preprocessing = Callable[[Sequence[Size], Size, bool], Iterator[Plan]]
"""Gives what a tool may have done with photos of these sizes, the likeliest first: (sizes, processed size, whether the processed images have white sides)."""

MIDDLE = (0.25, 0.75)
"""Principal points lie between these parts of the width and the height."""

FOCAL = (0.1, 20.0)
"""Focal lengths lie between these, relative to the longer side: 157 to 3 degrees across."""

ROUNDING = 0.01
"""Floats of images may be this far outside of 0 to 1."""

SKEWED = 1e-3
"""Largest skew of intrinsics, relative to the focal length."""


@dataclass(frozen=True, eq=False)
class Predicted:
    """Cameras and depth that a tool predicted.

    Attributes:
        path: the file.
        tool: its name.
        world_from_camera: poses [n 4 4], OpenCV axes.
        intrinsics: [n 3 3] at the processed size, the centre of the first pixel at (0.5, 0.5).
        depth: z-depths [n h w], 0 where unknown.
        unit: "metric" or "unknown".
        preprocessing: what the tool does with photos.
        upright: whether it turns photos as their EXIF orientation says.
        poses_key: the field that the poses are from.
        to_world: whether that field has them as camera to world, not as world to camera.
        unsure: share of the pixels whose depth is unknown.
        unsure_because: which depth counts as unknown, in words; empty if the file has no confidence.
        images: the processed images [n h w 3], uint8; None if the file has none.
        names: of the photos, as the file has them; None if it has none.
    """

    path: Path
    tool: str
    world_from_camera: np.ndarray
    intrinsics: np.ndarray
    depth: np.ndarray = field(repr=False)
    unit: str
    preprocessing: Preprocessing
    upright: bool
    poses_key: str
    to_world: bool
    unsure: float = 0.0
    unsure_because: str = ""
    images: np.ndarray | None = field(default=None, repr=False)
    names: Sequence[str] | None = None

    @property
    def size(self) -> Size:
        """(height, width) of the processed images [px]."""
        return self.depth.shape[1], self.depth.shape[2]

    def __len__(self) -> int:
        """The number of photos."""
        return len(self.depth)


def check_depth(path: Path, key: str, values: np.ndarray) -> np.ndarray:
    """Depth maps [n h w], float32, 0 where unknown or not finite.

    Raises:
        InputError: they are no maps of two or more photos, or a depth is negative.
    """
    depth = without_axes(values, 3)
    if depth is None or len(depth) < 2 or min(depth.shape) < 1:
        raise InputError(path, "depth maps [n h w] of two or more photos", f"an array of shape {values.shape}", key)
    depth = depth.astype(np.float32)
    depth[~np.isfinite(depth) | (depth >= FARTHEST)] = 0
    if depth.min() < 0:
        frame = int(np.argmax((depth < 0).any(axis=(1, 2))))
        found = f"{depth[frame].min():.4g}"
        raise InputError(path, "z-depths that are positive, or 0 where unknown", found, f"{key}[{frame}]")
    if not depth.any(axis=(1, 2)).all():
        frame = int(np.argmin(depth.any(axis=(1, 2))))
        raise InputError(path, "a map with some known depth", "0 everywhere", f"{key}[{frame}]")
    return depth


def check_like_depth(path: Path, key: str, values: np.ndarray, depth: np.ndarray) -> np.ndarray:
    """Maps of the same photos and size as the depth, such as confidences.

    Raises:
        InputError: they have another shape.
    """
    maps = without_axes(values, 3)
    if maps is None or maps.shape != depth.shape:
        raise InputError(path, f"maps of shape {depth.shape}, as the depth", f"an array of shape {values.shape}", key)
    return maps


def check_images(path: Path, key: str, values: np.ndarray, depth: np.ndarray) -> np.ndarray:
    """Images [n h w 3], uint8. Stored ones may also be [n 3 h w], or floats from 0 to 1.

    Raises:
        InputError: they have another shape or type.
    """
    images = without_axes(values, 4)
    expected = (*depth.shape, 3)
    if images is not None and images.shape != expected and images.shape == (len(depth), 3, *depth.shape[1:]):
        images = images.transpose(0, 2, 3, 1)
    if images is None or images.shape != expected:
        raise InputError(path, f"images of shape {expected}, as the depth", f"an array of shape {values.shape}", key)
    if images.dtype == np.uint8:
        return np.ascontiguousarray(images)
    eight_bits = np.empty(expected, np.uint8)
    for index, image in enumerate(images):  # one by one, as floats of many photos need much memory
        if image.dtype.kind != "f" or not (image.min() >= -ROUNDING and image.max() <= 1 + ROUNDING):
            found = f"{images.dtype} from {image.min():.4g} to {image.max():.4g}"
            raise InputError(path, "images of 8 bits, or of floats from 0 to 1", found, f"{key}[{index}]")
        eight_bits[index] = np.rint(255 * image.clip(0, 1))
    return eight_bits


def check_poses(path: Path, key: str, values: np.ndarray, count: int, *, to_world: bool) -> np.ndarray:
    """Poses [n 4 4], camera to world. Stored ones are [n 3 4] or [n 4 4].

    Args:
        path: the file.
        key: of the poses.
        values: as stored.
        count: of the photos.
        to_world: whether they are stored as camera to world, not as world to camera.

    Raises:
        InputError: they have another shape, or one is not a rigid motion.
    """
    poses = without_axes(values, 3)
    if poses is None or len(poses) != count or poses.shape[1:] not in ((3, 4), (4, 4)):
        raise InputError(
            path, f"{count} poses [n 3 4] or [n 4 4], as many as depth maps", f"an array of shape {values.shape}", key
        )
    whole = np.tile(np.eye(4), (count, 1, 1))
    whole[:, : poses.shape[1]] = poses
    direction = "camera-to-world" if to_world else "world-to-camera"
    expected = f"a {direction} matrix [R t; 0 0 0 1] of finite numbers, R a rotation"
    checked = checked_poses(path, list(whole), [f"{key}[{index}]" for index in range(count)], expected)
    return checked if to_world else np.linalg.inv(checked)


def check_intrinsics(path: Path, key: str, values: np.ndarray, depth: np.ndarray) -> np.ndarray:
    """Intrinsics [n 3 3] of the processed images.

    Raises:
        InputError: they have another shape, or one is not a camera of images of this size.
    """
    matrices = without_axes(values, 3)
    if matrices is None or matrices.shape != (len(depth), 3, 3):
        raise InputError(path, f"intrinsics of shape {(len(depth), 3, 3)}", f"an array of shape {values.shape}", key)
    matrices = matrices.astype(np.float64)
    height, width = depth.shape[1:]
    for index, matrix in enumerate(matrices):
        found = _implausible(matrix, (height, width))
        if found:
            raise InputError(
                path, f"a camera of images of {width}x{height} (width x height)", found, f"{key}[{index}]",
                "if they are the intrinsics of the full-size photos, save those of the processed images",
            )  # fmt: skip
    return matrices


def _implausible(matrix: np.ndarray, size: Size) -> str | None:
    """What is wrong with intrinsics [3 3]; None if they are possible."""
    if not np.isfinite(matrix).all():
        return "a number that is not finite"
    (fx, skew, cx), (below, fy, cy), last = matrix.tolist()
    if last != [0.0, 0.0, 1.0] or below != 0 or abs(skew) > SKEWED * abs(fx):
        return "another matrix than [fx 0 cx; 0 fy cy; 0 0 1]"
    longer = max(size)
    if not all(FOCAL[0] * longer < focal < FOCAL[1] * longer for focal in (fx, fy)):
        return f"focal lengths of {fx:.6g} and {fy:.6g} pixels"
    if not all(MIDDLE[0] < centre / side < MIDDLE[1] for centre, side in ((cx, size[1]), (cy, size[0]))):
        return f"a principal point at ({cx:.6g}, {cy:.6g})"
    return None


def without_axes(values: np.ndarray, axes: int) -> np.ndarray | None:
    """An array with so many axes: axes of length 1 in front of it, behind the number of the photo, or at its end are dropped. None if there are
    none or not enough."""
    while values.ndim > axes:
        places = [axis for axis in (values.ndim - 1, 1, 0) if values.shape[axis] == 1]
        if not places:
            return None
        values = values.squeeze(places[0])
    return values if values.ndim == axes else None
