"""Mistakes in arrays that a caller makes views from: what a reader of files would notice."""

from __future__ import annotations

import warnings
from collections.abc import Callable
from functools import lru_cache

import cv2
import numpy as np
import torch
from jaxtyping import Float, Float64
from torch import Tensor

from semgs.data.bounds.sift import LONGEST_SIDE, mutual_matches, sift
from semgs.data.cameras.lens import FOCAL, FURTHEST_CENTRE, NORMALISED
from semgs.geometry.cameras import Cameras

CORNER, EDGE = 0.9, (0.25, 0.7)
"""Principal points at this share of the width and of the height, or further, are those of another image size; beyond these they may be."""

ALIKE = 0.1
"""Both shares have to be so much alike: a crop moves the principal point along one side, another size along both."""

FEATURES = 600
FEWEST = 25
"""Fewer matches say nothing about poses."""

MOST_TRIED = 5
"""So many images are looked at for two neighbours with matches."""

FITS_PX = 2.0
"""Matches that miss the epipolar line by less than this fit [px of the reduced images]."""

MOST, FEW = 0.6, 0.6
"""Poses are wrong if at least the first share of the matches fits in front of the cameras read in another way, and as given at most the second part of it."""

OPENGL = np.diag([1.0, -1.0, -1.0, 1.0])
"""OpenGL's camera axes in OpenCV's."""

CLEARLY = 0.8
"""A reading fits clearly better than another if that fits at most this part of what it fits. Poses that fit more are right."""

OFF = 5.0
"""Poses that nothing explains are warned of if few matches fit even to so many times `FITS_PX`."""


def _with(
    poses: Float64[np.ndarray, "n 4 4"], rotations: np.ndarray, positions: np.ndarray
) -> Float64[np.ndarray, "n 4 4"]:
    """Poses with other rotations [n 3 3] and positions [n 3 1]."""
    changed = poses.copy()
    changed[:, :3, :3], changed[:, :3, 3:] = rotations, positions
    return changed


READINGS: dict[str, Callable[[np.ndarray], np.ndarray]] = {
    "are world to camera: pass their inverse": np.linalg.inv,
    "look like OpenGL's or Blender's, y up and z backward: multiply world_from_camera by diag(1, -1, -1, 1) from the right": lambda poses: (
        poses @ OPENGL
    ),
    "are world to camera, with OpenGL's axes: pass inv(poses) @ diag(1, -1, -1, 1)": lambda poses: (
        np.linalg.inv(poses) @ OPENGL
    ),
    "have the rotations of world to camera: transpose world_from_camera[:, :3, :3] and leave the positions as they are": lambda poses: (
        _with(poses, poses[:, :3, :3].mT, poses[:, :3, 3:])
    ),
    "have the translations t of world to camera as positions: these are -R @ t, with R as in world_from_camera": lambda poses: (
        _with(poses, poses[:, :3, :3], -poses[:, :3, :3] @ poses[:, :3, 3:])
    ),
}
"""What poses that do not fit may be, with what to do about it, and the right poses then."""


def check_intrinsics(cameras: Cameras) -> None:
    """Refuse intrinsics that cannot be those of images of this size, and warn about those that probably are not.

    Raises:
        ValueError: a focal length or a principal point is not within the limits of lenses, or the principal point is in the corner.
    """
    matrices = cameras.intrinsics.reshape(-1, 3, 3).numpy()
    height, width = cameras.size
    longer, sides = max(height, width), f"images of {height}x{width} (height x width)"
    for index, (focal, centre) in enumerate(zip(matrices[:, (0, 1), (0, 1)], matrices[:, :2, 2], strict=True)):
        said = f"intrinsics[{index}] has focal lengths {focal[0]:g} and {focal[1]:g} px and the principal point ({centre[0]:g}, {centre[1]:g})"
        if focal.max() < NORMALISED and np.abs(centre).max() <= 1 < longer:
            raise ValueError(
                f"{said}; expected pixels of {sides}. They look divided by the image size, as those of MVSplat are: multiply the first row by the "
                "width and the second by the height"
            )
        if not (FOCAL[0] * longer <= focal.min() and focal.max() <= FOCAL[1] * longer):
            raise ValueError(
                f"{said}; expected focal lengths of {FOCAL[0]:g} to {FOCAL[1]:g} times the longer side of {sides}"
            )
        if np.abs(centre).max() > FURTHEST_CENTRE * longer:
            raise ValueError(f"{said}; expected it within {FURTHEST_CENTRE:g} times the longer side of {sides}")
        across, down = centre / (width, height)
        if abs(across - down) > ALIKE * abs(across + down) / 2 or longer < NORMALISED:
            continue
        other = f"They look like those of images of {2 * (across + down) / 2:.2g} times this size: scale the first two rows with the images"
        if across >= CORNER:
            raise ValueError(f"{said}; expected it near the middle of {sides}. {other}")
        if not EDGE[0] < across < EDGE[1]:
            warnings.warn(f"{said}, in {sides}. {other}, or ignore this if the images are crops", stacklevel=3)


def warn_of_copies(images: Float[Tensor, "v 3 h w"], cameras: Cameras) -> None:
    """Warn if a view is there twice: the same image with the same pose adds nothing."""
    poses = cameras.world_from_camera
    for second in range(1, len(images)):
        for first in range(second):
            if torch.equal(poses[first], poses[second]) and torch.equal(images[first], images[second]):
                warnings.warn(f"views {first} and {second} have the same image and pose; leave one out", stacklevel=3)
                return


def warn_of_poses(images: Float[Tensor, "v 3 h w"], cameras: Cameras) -> None:
    """Warn if neighbouring images show that the poses do not fit: in words which of `READINGS` fits, if one does so clearly.

    The first pair of images with matches decides. If it does not, that and the following ones together do.
    """
    scale, pairs = min(1.0, LONGEST_SIDE / max(cameras.size)), range(1, min(len(images), MOST_TRIED))
    features = lru_cache(lambda index: sift(_grey(images[index], scale), FEATURES))
    each = list[list[float]]()
    for second in pairs:
        (first_places, descriptors), (second_places, others) = features(second - 1), features(second)
        i, j = mutual_matches(descriptors, others)
        pair = slice(second - 1, second + 1)
        matrices, poses = cameras.intrinsics[pair].numpy(), cameras.world_from_camera[pair].numpy()
        if len(i) < FEWEST or (poses[0, :3, 3] == poses[1, :3, 3]).all():
            continue
        rays = [
            np.column_stack((places / scale, np.ones(len(places)))) @ np.linalg.inv(matrix).T
            for places, matrix in zip((first_places[i], second_places[j]), matrices, strict=True)
        ]
        pixel = 1 / (scale * float(matrices[:, 0, 0].min()))
        readings = (poses, *(read(poses) for read in READINGS.values()))
        shares = [_fitting(rays[0], rays[1], reading, pixel) for reading in readings]
        each.append([_fitting(rays[0], rays[1], poses, OFF * pixel), _fitting_any(rays[0], rays[1], pixel), *shares])
        about, best, given, *others_fit = np.mean(each, axis=0).tolist()
        likeliest = int(np.argmax(others_fit))
        fits = others_fit.pop(likeliest)
        if given > CLEARLY * max(best, fits):
            return
        if given <= FEW * fits and fits >= MOST and max(others_fit) <= CLEARLY * fits:
            between = f"between images {second - 1} and {second}" if len(each) == 1 else "between neighbouring images"
            said = f"the poses {list(READINGS)[likeliest]}. Matches {between} fit them only then"
            warnings.warn(said, stacklevel=3)
            return
    if each and best >= MOST and about <= FEW * best:
        warnings.warn(
            f"the poses do not fit the images: {given:.0%} of the matches between neighbouring images agree with them, and no usual mistake explains it. "
            "They should be camera to world, with x right, y down and z forward, and in the order of the images",
            stacklevel=3,
        )


def _grey(image: Float[Tensor, "3 h w"], scale: float) -> np.ndarray:
    """An image in grey, uint8, reduced by a scale."""
    grey = (255 * image.detach().cpu().mean(0)).round().byte().numpy()
    return np.asarray(cv2.resize(grey, None, fx=scale, fy=scale, interpolation=cv2.INTER_AREA))


def _fitting(first: np.ndarray, second: np.ndarray, poses: Float64[np.ndarray, "2 4 4"], pixel: float) -> float:
    """The share of matches, as rays in two cameras, that meet in front of both to within `FITS_PX` pixels, each of an angle `pixel`."""
    baseline = poses[1, :3, 3] - poses[0, :3, 3]
    length = float(np.linalg.norm(baseline))
    if not length > 0:
        return 0.5  # nothing can be said
    a, b = (rays @ pose[:3, :3].T for rays, pose in zip((first, second), poses, strict=True))
    a, b = (rays / np.linalg.norm(rays, axis=1, keepdims=True) for rays in (a, b))
    normal = np.cross(baseline / length, a)
    normal /= np.maximum(np.linalg.norm(normal, axis=1, keepdims=True), 1e-12)
    near = np.abs((normal * b).sum(1)) < FITS_PX * pixel
    cosine = (a * b).sum(1)
    sine_squared = np.maximum(1 - cosine**2, 1e-18)
    in_front = ((a - cosine[:, None] * b) @ baseline > 0) & ((cosine[:, None] * a - b) @ baseline > 0)
    still = sine_squared < pixel**2  # too far away to tell in front from behind
    return float((near & (in_front | still)).mean())


def _fitting_any(first: np.ndarray, second: np.ndarray, pixel: float) -> float:
    """The share of matches that any two poses fit at best."""
    a, b = (np.ascontiguousarray(rays[:, :2] / rays[:, 2:]) for rays in (first, second))
    _, inside = cv2.findEssentialMat(a, b, np.eye(3), cv2.RANSAC, 0.999, FITS_PX * pixel)
    return 0.0 if inside is None else float(inside.mean())
