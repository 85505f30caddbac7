"""Gaussians and cameras in another frame: rigid motions, and a scale for Gaussians."""

from __future__ import annotations

from dataclasses import replace

from jaxtyping import Float64
from torch import Tensor

from semgs.geometry.cameras import Cameras
from semgs.geometry.gaussians import Appearance, Gaussians
from semgs.geometry.harmonics_rotation import rotate_harmonics
from semgs.geometry.rotations import quaternion_from_matrix, quaternion_product


def move_gaussians(b_from_a: Float64[Tensor, "4 4"], gaussians: Gaussians, *, scale: float = 1.0) -> Gaussians:
    """The Gaussians of one scene in another frame: positions, axes, sizes and the harmonics of their colours.

    Positions x become scale R x + t, computed in float64 and rounded once.

    Args:
        b_from_a: R and t, rotation and translation from the frame of the Gaussians to the other.
        gaussians: without a batch axis.
        scale: length of a unit of the Gaussians' frame in the other.
    """
    rotation = b_from_a[:3, :3]
    turn = quaternion_from_matrix(rotation)
    means = scale * gaussians.means.double() @ rotation.T + b_from_a[:3, 3]
    harmonics = rotate_harmonics(gaussians.colour.features[None], rotation[None])[0]

    def turned(shape: Appearance) -> Appearance:
        scales = shape.scales if scale == 1 else (scale * shape.scales.double()).to(shape.scales)
        return Appearance(quaternion_product(turn.to(shape.quaternions), shape.quaternions), scales, shape.features)

    return replace(
        gaussians,
        means=means.to(gaussians.means),
        colour=replace(turned(gaussians.colour), features=harmonics),
        semantic=None if gaussians.semantic is None else turned(gaussians.semantic),
        footprints=None if gaussians.footprints is None else scale**2 * gaussians.footprints,
    )


def move_cameras(b_from_a: Float64[Tensor, "4 4"], cameras: Cameras) -> Cameras:
    """The cameras in another frame; arguments as for `move_gaussians`."""
    return Cameras.trusted(b_from_a @ cameras.world_from_camera, cameras.intrinsics, cameras.size)
