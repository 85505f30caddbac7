"""Cameras: pinhole, OpenCV axes (x right, y down, z forward), metres, intrinsics in pixels.

The corner of the first pixel is at (0, 0) and its centre at (0.5, 0.5), so `intrinsics` of an image of width W whose
optical axis passes through its middle has cx = W / 2. A point X of the world is seen at u = K (R^T (X - t)) / z with
`world_from_camera` = [R | t]. Every reader converts to this convention; no other one exists inside the package.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
import torch
from jaxtyping import Float, Float64
from torch import Tensor

from semgs.geometry.rotations import nearest_rotation, why_no_rotation
from semgs.geometry.summaries import describe_tensor

Arrays = np.ndarray | Tensor | Sequence
"""Numbers in any of the forms that callers have."""

ROTATION_TOLERANCE = 1e-2
"""Poses whose 3x3 part differs from a rotation by more than this (largest element) are refused; ScanNet's are within 1e-3."""


@dataclass(frozen=True, init=False)
class Cameras:
    """Pinhole cameras of one image size, with any leading batch axes.

    All input (arrays, lists, tensors of any dtype or device) is stored as float64 on the CPU; only relative poses, in float32, go to a
    device. Poses that are nearly rigid are orthonormalised.

    Attributes:
        world_from_camera: poses, camera to world, OpenCV axes [m].
        intrinsics: K = [[fx, s, cx], [0, fy, cy], [0, 0, 1]] [px].
        size: image (height, width) [px].

    Raises:
        ValueError: shapes disagree, a number is not finite, a pose is far from a rigid motion, a focal length is not
            positive, or the size is not two positive integers.
    """

    world_from_camera: Float64[Tensor, "*batch 4 4"]
    intrinsics: Float64[Tensor, "*batch 3 3"]
    size: tuple[int, int]

    def __init__(self, world_from_camera: Arrays, intrinsics: Arrays, size: Sequence[int]) -> None:
        poses = as_float64(world_from_camera)
        matrices = as_float64(intrinsics)
        if poses.ndim == 2 and matrices.ndim > 2:
            raise ValueError(
                f"world_from_camera is {tuple(poses.shape)} for {len(matrices)} cameras; expected [v 4 4], a pose for each"
            )
        if poses.shape[-2:] != (4, 4) or matrices.shape[-2:] != (3, 3) or poses.shape[:-2] != matrices.shape[:-2]:
            raise ValueError(
                f"world_from_camera is {tuple(poses.shape)} and intrinsics is {tuple(matrices.shape)}; "
                "expected [... 4 4] and [... 3 3] with equal leading axes"
            )
        size = checked_size(size)
        vars(self).update(world_from_camera=_rigid(poses), intrinsics=_checked_intrinsics(matrices), size=size)

    @classmethod
    def trusted(cls, world_from_camera: Tensor, intrinsics: Tensor, size: tuple[int, int]) -> Cameras:
        """Cameras computed from checked cameras: nothing is checked, copied or orthonormalised again."""
        cameras = object.__new__(cls)
        vars(cameras).update(world_from_camera=world_from_camera, intrinsics=intrinsics, size=size)
        return cameras

    def __repr__(self) -> str:
        views = " ".join(map(str, self.batch))
        return f"Cameras([{views}] of {self.size[0]}x{self.size[1]}; focal lengths {describe_tensor(self.focal_px)} px)"

    def arranged(self, function: Callable[..., Tensor], *others: Cameras) -> Cameras:
        """The cameras rearranged: `function` indexes, joins or reshapes the leading axes of poses and intrinsics.

        Args:
            function: takes the array of these cameras, then that of each of the others.
            others: of the same size.
        """
        cameras = (self, *others)
        poses = function(*(each.world_from_camera for each in cameras))
        return Cameras.trusted(poses, function(*(each.intrinsics for each in cameras)), self.size)

    def adjusted(self, new_from_old: Float64[Tensor, "3 3"], size: tuple[int, int]) -> Cameras:
        """The cameras of cropped or resized images.

        Args:
            new_from_old: from (x, y, 1) in the old image to the same point in the new one [px].
            size: (height, width) of the new images [px].
        """
        return Cameras.trusted(self.world_from_camera, new_from_old @ self.intrinsics, size)

    def relative_to(self, origin: Arrays) -> Cameras:
        """The same cameras in a world with its origin at the point `origin` [3] of this world, and the same axes."""
        poses = self.world_from_camera.clone()
        poses[..., :3, 3] -= as_float64(origin)
        return Cameras.trusted(poses, self.intrinsics, self.size)

    @classmethod
    def check_type(cls, value: object) -> None:
        """Refuse what is given for cameras and is none.

        Raises:
            TypeError: it has another type.
        """
        if not isinstance(value, cls):
            raise TypeError(f"cameras are {type(value).__name__}; expected semgs.Cameras, such as views.cameras")

    @property
    def batch(self) -> tuple[int, ...]:
        """The leading axes."""
        return tuple(self.world_from_camera.shape[:-2])

    @property
    def camera_from_world(self) -> Float64[Tensor, "*batch 4 4"]:
        """The inverse poses, in closed form."""
        return inverse_rigid(self.world_from_camera)

    @property
    def centres(self) -> Float64[Tensor, "*batch 3"]:
        """The optical centres in the world [m]."""
        return self.world_from_camera[..., :3, 3]

    @property
    def focal_px(self) -> Float64[Tensor, "*batch 2"]:
        """(fx, fy) [px]."""
        return self.intrinsics.diagonal(dim1=-2, dim2=-1)[..., :2]

    def flatten(self) -> Cameras:
        """The cameras with a single leading axis."""
        return self.arranged(lambda array: array.reshape(-1, *array.shape[-2:]))

    def __getitem__(self, index: int | slice | Sequence[int] | Tensor | tuple) -> Cameras:
        """The cameras at an index of the leading axes."""
        return self.arranged(lambda array: array[index])


def checked_size(size: Sequence[int]) -> tuple[int, int]:
    """An image (height, width) as two integers [px].

    Raises:
        ValueError: it is not two positive integers.
        TypeError: it is no pair.
    """
    if isinstance(size, str) or not isinstance(size, Sequence | np.ndarray | Tensor):
        raise TypeError(f"size is {type(size).__name__}; expected two positive integers (height, width)")
    height, width = (int(side) for side in size) if len(size) == 2 else (0, 0)
    if (height, width) != tuple(size) or height < 1 or width < 1:
        raise ValueError(f"size is {tuple(size)}; expected two positive integers (height, width)")
    return height, width


def as_float64(numbers: Arrays) -> Float64[Tensor, " ..."]:
    """Numbers in any form as a float64 tensor on the CPU, without gradient.

    Raises:
        TypeError: they are no numbers.
    """
    if isinstance(numbers, Tensor):
        return numbers.detach().to("cpu", torch.float64)
    if isinstance(numbers, list | tuple) and numbers and isinstance(numbers[0], Tensor):
        return torch.stack([as_float64(tensor) for tensor in numbers])
    if isinstance(numbers, str) or not isinstance(numbers, Sequence | np.ndarray | float | int):
        raise TypeError(f"an array is {type(numbers).__name__}; expected numbers")
    return torch.as_tensor(writable(np.asarray(numbers, dtype=np.float64)))


def writable(numbers: Any) -> Any:
    """An array, or a copy if it is read-only, which PyTorch warns about, or has the other order of bytes or runs backwards, which it refuses. Anything else as it is."""
    if not isinstance(numbers, np.ndarray):
        return numbers
    native = numbers.astype(numbers.dtype.newbyteorder("="), copy=False)
    return native if native.flags.writeable and min(native.strides, default=0) >= 0 else native.copy()


def inverse_rigid(transforms: Float[Tensor, "*batch 4 4"]) -> Float[Tensor, "*batch 4 4"]:
    """Inverse of rigid motions [R | t]: [R^T | -R^T t], without a general matrix inverse."""
    rotation, translation = transforms[..., :3, :3], transforms[..., :3, 3:]
    inverse = torch.zeros_like(transforms)
    inverse[..., :3, :3] = rotation.mT
    inverse[..., :3, 3:] = -rotation.mT @ translation
    inverse[..., 3, 3] = 1
    return inverse


def pixel_centres(size: tuple[int, int], dtype: torch.dtype = torch.float64) -> Float[Tensor, "h w 2"]:
    """(x, y) of every pixel's centre, at .5 [px]."""
    height, width = size
    rows = torch.arange(height, dtype=dtype) + 0.5
    columns = torch.arange(width, dtype=dtype) + 0.5
    return torch.stack(torch.meshgrid(columns, rows, indexing="xy"), dim=-1)


def back_project(depths: Float[Tensor, "*batch h w"], cameras: Cameras) -> Float[Tensor, "*batch h w 3"]:
    """World points of pixel centres at z-depth `depths`: R (K^-1 [x, y, 1] z) + t, in the dtype of `depths`.

    Raises:
        ValueError: the depth maps are not of the cameras' size.
    """
    if tuple(depths.shape[-2:]) != cameras.size:
        raise ValueError(
            f"depths are {tuple(depths.shape[-2:])} (height, width) but their cameras are for {cameras.size}"
        )
    centres = pixel_centres(cameras.size)
    rays = torch.cat((centres, torch.ones_like(centres[..., :1])), dim=-1)
    directions = cameras.world_from_camera[..., :3, :3] @ torch.linalg.inv(cameras.intrinsics)
    world = torch.einsum("...ij,hwj->...hwi", directions, rays).to(depths)
    return world * depths[..., None] + cameras.centres.to(depths)[..., None, None, :]


def project(points: Float[Tensor, "*batch n 3"], cameras: Cameras) -> Float[Tensor, "*batch n 3"]:
    """(x, y, z) of world points in each camera: pixel position and z-depth [px, px, m]; x and y are meaningless if z <= 0."""
    pose = cameras.camera_from_world.to(points)
    inside = points @ pose[..., :3, :3].mT + pose[..., None, :3, 3]
    homogeneous = inside @ cameras.intrinsics.to(points).mT
    depth = inside[..., 2:]
    return torch.cat((homogeneous[..., :2] / depth, depth), dim=-1)


def _rigid(poses: Float64[Tensor, "*batch 4 4"]) -> Float64[Tensor, "*batch 4 4"]:
    """The poses with orthonormal rotations; refuses poses that are not rigid motions."""
    if not torch.isfinite(poses).all():
        raise ValueError(
            f"world_from_camera{_first(~torch.isfinite(poses).all(-1).all(-1))} has a number that is not finite"
        )
    last = poses.new_tensor([0.0, 0.0, 0.0, 1.0])
    bad = ((poses[..., 3, :] - last).abs() > 1e-6).any(-1)
    if bad.any():
        raise ValueError(f"world_from_camera{_first(bad)} has a last row other than (0, 0, 0, 1)")
    rotation = poses[..., :3, :3]
    exact = ((rotation @ rotation.mT - torch.eye(3, dtype=poses.dtype)).abs() < 1e-12).all(-1).all(-1)
    if (exact & (torch.linalg.det(rotation) > 0)).all():  # cheaper than finding the nearest
        return poses.clone()
    nearest = nearest_rotation(rotation)
    bad = ((rotation - nearest).abs() > ROTATION_TOLERANCE).any(-1).any(-1)
    if bad.any():
        index = _first(bad)
        first = rotation[bad].reshape(-1, 3, 3)[0]
        kind, advice = why_no_rotation(first)
        raise ValueError(
            f"world_from_camera{index} is not a rigid motion: its 3x3 part has determinant {torch.linalg.det(first):.4g} and is more than "
            f"{ROTATION_TOLERANCE} from the nearest rotation ({kind}); {advice or 'expected camera-to-world poses without scale or reflection'}"
        )
    rigid = poses.clone()
    rigid[..., :3, :3] = torch.where(exact[..., None, None], rotation, nearest)
    return rigid


def _checked_intrinsics(intrinsics: Float64[Tensor, "*batch 3 3"]) -> Float64[Tensor, "*batch 3 3"]:
    """The intrinsics, unchanged; refuses what is not [[fx, s, cx], [0, fy, cy], [0, 0, 1]] with finite numbers and fx, fy > 0."""
    if not torch.isfinite(intrinsics).all():
        raise ValueError(
            f"intrinsics{_first(~torch.isfinite(intrinsics).all(-1).all(-1))} has a number that is not finite"
        )
    focal = intrinsics.diagonal(dim1=-2, dim2=-1)[..., :2]
    if (focal <= 0).any():
        bad = (focal <= 0).any(-1)
        fx, fy = focal[bad].reshape(-1, 2)[0].tolist()
        raise ValueError(
            f"intrinsics{_first(bad)} has focal lengths fx = {fx:g}, fy = {fy:g}; expected positive ones, in pixels"
        )
    last = intrinsics.new_tensor([0.0, 0.0, 1.0])
    bad = ((intrinsics[..., 2, :] - last).abs() > 1e-9).any(-1) | (intrinsics[..., 1, 0].abs() > 1e-9)
    if bad.any():
        raise ValueError(f"intrinsics{_first(bad)} is not [[fx, s, cx], [0, fy, cy], [0, 0, 1]]")
    return intrinsics


def _first(bad: Tensor) -> str:
    """The index of the first true element, to write after a name ("[0, 2]"; empty for a scalar)."""
    if bad.ndim == 0:
        return ""
    return str(bad.nonzero()[0].tolist())


def shrink_cameras(cameras: Cameras, stride: int) -> Cameras:
    """The cameras of images whose sides are `stride` times smaller."""
    if stride == 1:
        return cameras
    scale = torch.diag(torch.tensor([1 / stride, 1 / stride, 1.0], dtype=torch.float64))
    height, width = cameras.size
    return cameras.adjusted(scale, (height // stride, width // stride))
