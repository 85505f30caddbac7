"""The usual mistakes, made in the cameras of a scene as its files would have them."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import ClassVar

import numpy as np
from scipy.spatial.transform import Rotation

from semgs.data.cameras.lens import Lens, carry_over
from semgs.data.maps import MapSource, Pixels
from semgs.doctor.rig import Rig

OPENGL = np.diag([1.0, -1.0, -1.0, 1.0])


@dataclass(frozen=True)
class Planted:
    """A mistake to make.

    Attributes:
        name: that of the mistake in `semgs.doctor.mistakes`.
        make: the wrong cameras from the right ones of a transforms.json; the generator chooses between forms of the mistake.
    """

    name: str
    make: Callable[[Rig, np.random.Generator], Rig]


def _as_file(rig: Rig, change: Callable[[np.ndarray], np.ndarray]) -> Rig:
    """Change each camera-to-world matrix with OpenGL axes, as it stands in the file."""
    return replace(rig, poses=np.stack([change(pose @ OPENGL) @ OPENGL for pose in rig.poses]))


def _inverted(rig, rng):
    return _as_file(rig, np.linalg.inv)


def _opencv_axes(rig, rng):
    return _as_file(rig, lambda matrix: matrix @ OPENGL)


def _extrinsics_pasted(rig, rng):
    return _as_file(rig, lambda matrix: np.linalg.inv(matrix @ OPENGL))


def _transposed(rig, rng):
    def transposed(matrix):
        return np.block([[matrix[:3, :3].T, matrix[:3, 3:]], [np.array([[0, 0, 0, 1.0]])]])

    return _as_file(rig, transposed)


def _translations(rig, rng):
    """camera to world [R^T | t], with R and t of world to camera in OpenCV's axes; half the time in those of the file."""
    axes = OPENGL if rng.random() < 0.5 else np.eye(4)

    def translated(matrix):
        return np.block([[matrix[:3, :3], np.linalg.inv(matrix @ axes)[:3, 3:]], [np.array([[0, 0, 0, 1.0]])]])

    return _as_file(rig, translated)


def _quaternion(rig, rng):
    first = rng.random() < 0.5

    def misread(matrix):
        x, y, z, w = Rotation.from_matrix(matrix[:3, :3]).as_quat()
        wrong = (w, x, y, z) if first else (y, z, w, x)
        rotation = Rotation.from_quat(wrong).as_matrix()
        return np.block([[rotation, matrix[:3, 3:]], [np.array([[0, 0, 0, 1.0]])]])

    return _as_file(rig, misread)


def _mirrored(rig, rng):
    world, camera = rng.integers(0, 3, 2)
    flips = np.ones((2, 4))
    flips[0, world], flips[1, camera] = -1, -1
    return _as_file(rig, lambda matrix: np.diag(flips[0]) @ matrix @ np.diag(flips[1]))


def _focal_swapped(rig, rng):
    return replace(rig, focal=rig.focal[:, ::-1].copy())


def _centre_swapped(rig, rng):
    return replace(rig, centre=rig.centre[:, ::-1].copy())


def _millimetres(rig, rng):
    poses = rig.poses.copy()
    poses[:, :3, 3] *= 1000
    return replace(rig, poses=poses)


def _depth_unit(rig, rng):
    return replace(rig, depth_unit=float(rng.choice([0.1, 10, 0.01, 100, 1000])))


def _along_ray(rig, rng):
    return replace(rig, along_ray=not rig.along_ray)


def _reversed(rig, rng):
    return replace(rig, poses=rig.poses[::-1].copy())


def _off_by_one(rig, rng):
    return replace(rig, poses=np.roll(rig.poses, int(rng.choice([-1, 1])), axis=0))


def _sorted_as_text(rig, rng):
    """Frames are numbered from 0: 0, 1, 10, 11, 2, ... Fewer than eleven have the same order both ways."""
    return replace(rig, poses=rig.poses[sorted(range(len(rig.poses)), key=str)].copy())


def _focal_of_other_size(rig, rng):
    factor = float(rng.choice([0.25, 0.5, 2 / 3, 0.75, 4 / 3, 1.5, 2, 4]))
    centre = rig.centre * factor if rng.random() < 0.5 else rig.centre
    return replace(rig, focal=rig.focal * factor, centre=centre)


def _centre_ignored(rig, rng):
    """The true principal point is the middle, the file's somewhere else: at the corner, or off by a tenth."""
    return replace(rig, centre=np.zeros_like(rig.centre) if rng.random() < 0.5 else rig.centre + 0.15 * rig.sizes)


PLANTED = (
    Planted("poses inverted (world to camera for camera to world, or the reverse)", _inverted),
    Planted("OpenGL and OpenCV axes confused", _opencv_axes),
    Planted("poses inverted, and OpenGL and OpenCV axes confused", _extrinsics_pasted),
    Planted("rotations transposed", _transposed),
    Planted("translations of world to camera as positions (or the reverse)", _translations),
    Planted("order of quaternions (w first or last)", _quaternion),
    Planted("mirrored world (left-handed coordinates)", _mirrored),
    Planted("fx and fy swapped", _focal_swapped),
    Planted("cx and cy swapped", _centre_swapped),
    Planted("positions in millimetres or centimetres", _millimetres),
    Planted("wrong unit of depth", _depth_unit),
    Planted("images in reverse order", _reversed),
    Planted("images off by one", _off_by_one),
    Planted("focal length of another image size", _focal_of_other_size),
    Planted("wrong principal point", _centre_ignored),
    Planted("depth along the ray instead of z", _along_ray),
)

SORTED_AS_TEXT = Planted("images sorted as text (10 before 9)", _sorted_as_text)
"""Needs eleven frames."""


@dataclass(frozen=True, eq=False)
class Unregistered:
    """Depth of a camera of its own, used as if it had been registered to the images.

    Attributes:
        depth: registered.
        focal: of the depth camera over that of the images: 585 / 525 for the first Kinect, 0.72 for a RealSense.
    """

    depth: MapSource
    focal: float
    stored: ClassVar[bool] = True

    def read(self, pixels: Pixels) -> np.ndarray:
        lens = pixels.lens
        assert isinstance(lens, Lens)
        fx, fy = lens.focal
        return carry_over(self.depth.read(pixels), lens, replace(lens, focal=(fx * self.focal, fy * self.focal)))


UNREGISTERED = (585 / 525, 0.72)
