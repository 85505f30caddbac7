"""The cameras of all frames as arrays, so that a suspected mistake can be undone in one step."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import final

import numpy as np
from jaxtyping import Float64, Int64

from semgs.data.cameras.lens import AbstractLens, matrix
from semgs.data.frames import Frame

POSES_ARE_INVERSE = ("COLMAP",)
"""Layouts whose files have world-to-camera poses; all others have camera-to-world."""

AXES_ARE_OPENGL = ("transforms.json", "ScanNet++ dslr")
"""Layouts whose files have OpenGL camera axes; all others have OpenCV's."""

NEAREST_TO_0 = 1e-9
"""Smaller inverse depth counts as this: what is at infinity is very far away."""

FLIP = np.diag([1.0, -1.0, -1.0, 1.0])
"""Between OpenGL's and OpenCV's camera axes, in both directions."""


@final
@dataclass(frozen=True, eq=False)
class Rig:
    """The cameras of all frames of a scene.

    Attributes:
        poses: world_from_camera, OpenCV axes; NaN for a frame without a pose [m, or the scene's unit].
        focal: (fx, fy) of each frame [px].
        centre: (cx, cy) of each frame [px].
        sizes: (width, height) of each frame [px].
        depth_unit: measured depths are multiplied by this.
        along_ray: whether measured depths are distances along the ray instead of z.
        disparity: the scale and shift of each frame if measured depths d are inverse depth, 1 / z = scale d + shift; None if they are depth.
    """

    poses: Float64[np.ndarray, "n 4 4"]
    focal: Float64[np.ndarray, "n 2"]
    centre: Float64[np.ndarray, "n 2"]
    sizes: Float64[np.ndarray, "n 2"]
    depth_unit: float = 1.0
    along_ray: bool = False
    disparity: Float64[np.ndarray, "n 2"] | None = None

    def z_depths(
        self,
        depths: Float64[np.ndarray, "*n"],
        rays: Float64[np.ndarray, "*n 2"],
        frames: Int64[np.ndarray, "*n"] | int,
    ) -> Float64[np.ndarray, "*n"]:
        """The z-depth that measured depths of frames on the rays (x, y, 1) stand for: a distance along the ray is z |(x, y, 1)|; 0 and NaN stay unknown."""
        if self.disparity is not None:
            scales, shifts = np.moveaxis(self.disparity[frames], -1, 0)
            return np.where(depths > 0, 1 / np.maximum(scales * depths + shifts, NEAREST_TO_0), depths)
        lengths = np.sqrt(1 + (rays**2).sum(-1)) if self.along_ray else 1.0
        return self.depth_unit * depths / lengths


def rig_of(frames: Sequence[Frame]) -> Rig:
    """The cameras as the scene's files give them."""
    return Rig(
        np.stack([frame.world_from_camera for frame in frames]),
        np.array([frame.lens.focal for frame in frames], dtype=np.float64),
        np.array([frame.lens.centre for frame in frames], dtype=np.float64),
        np.array([frame.lens.size[::-1] for frame in frames], dtype=np.float64),
    )


def undistorted_from_pinhole(lens: AbstractLens) -> Float64[np.ndarray, "3 3"]:
    """Takes (x, y, 1) of a pinhole with the focal length and principal point of a lens to the same in its undistorted images [px]."""
    return lens.intrinsics @ np.linalg.inv(matrix(lens.focal, lens.centre))


def inverse(poses: Float64[np.ndarray, "n 4 4"]) -> Float64[np.ndarray, "n 4 4"]:
    """The inverse of rigid motions [R | t]: [R^T | -R^T t]."""
    turned = poses[:, :3, :3].mT
    result = np.zeros_like(poses)
    result[:, :3, :3], result[:, :3, 3:], result[:, 3, 3] = turned, -turned @ poses[:, :3, 3:], 1
    return result


@final
@dataclass(frozen=True)
class FileConvention:
    """How the files of a layout write poses.

    Attributes:
        inverse: world-to-camera instead of camera-to-world.
        opengl: OpenGL's camera axes instead of OpenCV's.
    """

    inverse: bool
    opengl: bool

    @classmethod
    def of(cls, layout: str) -> FileConvention:
        """That of a layout, by the name in `Scene.layout`."""
        return cls(layout.startswith(POSES_ARE_INVERSE), layout.startswith(AXES_ARE_OPENGL))

    def written(self, poses: Float64[np.ndarray, "n 4 4"]) -> Float64[np.ndarray, "n 4 4"]:
        """The matrices in the files for some poses (world_from_camera, OpenCV axes)."""
        turned = poses @ FLIP if self.opengl else poses
        return inverse(turned) if self.inverse else turned

    def read(self, matrices: Float64[np.ndarray, "n 4 4"]) -> Float64[np.ndarray, "n 4 4"]:
        """The poses (world_from_camera, OpenCV axes) for the matrices in the files; the inverse of `written`."""
        poses = inverse(matrices) if self.inverse else matrices
        return poses @ FLIP if self.opengl else poses
