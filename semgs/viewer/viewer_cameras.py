"""Cameras of a viewer: the input views with their photos, and what a viewer looks through."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from math import atan, tan
from pathlib import Path

import numpy as np
import torch
from jaxtyping import UInt8

from semgs.export.colmap import photo_paths
from semgs.files.errors import InputError
from semgs.files.images.pictures import read_rgb
from semgs.geometry.cameras import Arrays, Cameras, as_float64
from semgs.geometry.rotations import matrix_from_quaternion, quaternion_from_matrix
from semgs.scene.scene_file import SavedScene
from semgs.viewer.splat_groups import TYPICAL_DEPTH

Triple = tuple[float, float, float]


@dataclass(frozen=True)
class InputView:
    """An input view as a viewer shows it, in the viewer's units; off-centre principal points and unequal focal lengths are ignored.

    Attributes:
        name: of its frame.
        position: of the optical centre.
        wxyz: quaternion of its axes.
        look_at: a point on the optical axis at the typical depth.
        fov: vertical field of view [radians].
        aspect: width / height of what it sees.
        photo: None if it is not known.
    """

    name: str
    position: Triple
    wxyz: tuple[float, float, float, float]
    look_at: Triple
    fov: float
    aspect: float
    photo: UInt8[np.ndarray, "h w 3"] | None = None


def input_views(
    scene: SavedScene, scale: float, photos: Sequence[UInt8[np.ndarray, "h w 3"]] = ()
) -> tuple[InputView, ...]:
    """The input views of a scene.

    Args:
        scene: the scene.
        scale: the viewer's units per unit of the scene.
        photos: one for each, or none.
    """
    height, width = scene.cameras.size
    views = []
    for index, name in enumerate(scene.frames):
        camera = scene.cameras[index]
        position = scale * camera.centres
        w, x, y, z = quaternion_from_matrix(camera.world_from_camera[:3, :3]).tolist()
        fx, fy = camera.focal_px.tolist()
        views.append(
            InputView(
                name=name,
                position=_triple(position),
                wxyz=(w, x, y, z),
                look_at=_triple(position + TYPICAL_DEPTH * camera.world_from_camera[:3, 2]),
                fov=2 * atan(height / (2 * fy)),
                aspect=(width / fx) / (height / fy),
                photo=photos[index] if photos else None,
            )
        )
    return tuple(views)


def camera_seen_from(wxyz: Arrays, position: Arrays, fov: float, size: tuple[int, int], scale: float) -> Cameras:
    """The camera of a viewer, in the scene's coordinates.

    Args:
        wxyz: quaternion of its axes, OpenCV.
        position: of its centre, in the viewer's units.
        fov: vertical field of view [radians].
        size: (height, width) of its image [px].
        scale: the viewer's units per unit of the scene.
    """
    pose = torch.eye(4, dtype=torch.float64)
    pose[:3, :3] = matrix_from_quaternion(as_float64(wxyz))
    pose[:3, 3] = as_float64(position) / scale
    height, width = size
    focal = height / (2 * tan(fov / 2))
    intrinsics = torch.tensor([[focal, 0, width / 2], [0, focal, height / 2], [0, 0, 1]], dtype=torch.float64)
    return Cameras(pose, intrinsics, size)


def pixel_of(direction: Arrays, camera: Cameras) -> tuple[float, float]:
    """The pixel of a camera that sees along a direction of the world."""
    inside = as_float64(direction) @ camera.world_from_camera[:3, :3]
    x, y, z = (camera.intrinsics @ inside).tolist()
    return x / z, y / z


def photos_in(folder: Path, scene: SavedScene) -> list[UInt8[np.ndarray, "h w 3"]]:
    """The photos of a scene's input views in the folder of `semgs reconstruct`; none if it does not contain them all."""
    try:
        return [read_rgb(path) for path in photo_paths(folder, scene)]
    except InputError:
        return []


def _triple(vector: torch.Tensor) -> Triple:
    x, y, z = vector.tolist()
    return x, y, z
