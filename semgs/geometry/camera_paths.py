"""Camera paths: where a video looks from."""

from __future__ import annotations

from math import pi, radians

import numpy as np
import torch
from jaxtyping import Float64
from scipy.interpolate import CubicSpline
from scipy.spatial.transform import Rotation, RotationSpline
from torch import Tensor

from semgs.geometry.cameras import Cameras


def orbit(
    camera: Cameras, pivot: Float64[Tensor, " 3"], up: Float64[Tensor, " 3"], degrees: float, count: int
) -> Cameras:
    """A camera that circles around a point and keeps its height and pitch; the path closes, so that a video can repeat.

    With 360 degrees it goes around once. With less it swings to both sides, half of the angle to each, starting in the middle.

    Args:
        camera: where it starts; one, without leading axes.
        pivot: a point of the axis.
        up: direction of the axis, of unit length.
        degrees: of the whole swing, at most 360.
        count: of cameras, [count].
    """
    steps = np.arange(count) / count
    angles = 2 * pi * steps if degrees >= 360 else radians(degrees) / 2 * np.sin(2 * pi * steps)
    turns = torch.from_numpy(Rotation.from_rotvec(angles[:, None] * up.numpy()).as_matrix())
    start = camera.world_from_camera
    poses = torch.eye(4, dtype=torch.float64).repeat(count, 1, 1)
    poses[:, :3, :3] = turns @ start[:3, :3]
    poses[:, :3, 3] = pivot + turns @ (start[:3, 3] - pivot)
    return Cameras.trusted(poses, camera.intrinsics.expand(count, 3, 3), camera.size)


def interpolate_cameras(cameras: Cameras, count: int) -> Cameras:
    """A smooth path from the first camera through all others to the last and back; it closes, and rests at both ends.

    Positions follow a natural cubic spline, rotations a spline with continuous angular acceleration, and intrinsics change linearly.

    Args:
        cameras: at least two, [v].
        count: of cameras, [count].
    """
    knots = np.arange(len(cameras.world_from_camera))
    places = (len(knots) - 1) * (1 - np.cos(2 * pi * np.arange(count) / count)) / 2
    poses = torch.eye(4, dtype=torch.float64).repeat(count, 1, 1)
    rotations = Rotation.from_matrix(cameras.world_from_camera[:, :3, :3].numpy())
    poses[:, :3, :3] = torch.from_numpy(RotationSpline(knots, rotations)(places).as_matrix())
    poses[:, :3, 3] = torch.from_numpy(CubicSpline(knots, cameras.centres.numpy(), bc_type="natural")(places))
    low = np.minimum(places.astype(int), len(knots) - 2)
    share = torch.from_numpy(places - low)[:, None, None]
    intrinsics = torch.lerp(cameras.intrinsics[low], cameras.intrinsics[low + 1], share)
    return Cameras.trusted(poses, intrinsics, cameras.size)


def resize_cameras(cameras: Cameras, size: tuple[int, int]) -> Cameras:
    """The cameras with images of another size: the same height of the view, and more or less of it to both sides.

    Args:
        cameras: any.
        size: (height, width) [px].
    """
    scale = size[0] / cameras.size[0]
    new_from_old = torch.tensor(
        [[scale, 0, (size[1] - scale * cameras.size[1]) / 2], [0, scale, 0], [0, 0, 1]], dtype=torch.float64
    )
    return cameras.adjusted(new_from_old, size)
