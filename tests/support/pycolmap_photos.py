"""Photos of a scene that pycolmap can solve: a floor of random squares with boxes on it, seen by cameras with known poses."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

import cv2
import numpy as np

from semgs.files.images.pictures import write_png

SIZE, FOCAL, CENTRE = (240, 320), 250.0, (160.0, 120.0)


@dataclass(frozen=True)
class Taken:
    """Photos in a folder and the cameras that took them."""

    folder: Path
    world_from_camera: np.ndarray


def texture(seed: int) -> np.ndarray:
    """A picture of random grey squares of several sizes, 512 x 512, RGB."""
    rng = np.random.default_rng(seed)
    layers = [rng.integers(0, 255, (side, side, 3)).astype(np.uint8) for side in (16, 48, 128)]
    return np.mean([cv2.resize(one, (512, 512), interpolation=cv2.INTER_NEAREST) for one in layers], axis=0).astype(
        np.uint8
    )


def picture(pose: np.ndarray, planes: list[tuple[float, float, float]], focal: float = FOCAL) -> np.ndarray:
    """What a camera sees of squares parallel to its first image plane: (x, depth, width) of each, the farthest first."""
    height, width = SIZE
    image = np.full((height, width, 3), 90, np.uint8)
    k = np.array([[focal, 0, CENTRE[0]], [0, focal, CENTRE[1]], [0, 0, 1.0]])
    camera_from_world = np.linalg.inv(pose)
    for number, (x, depth, side) in enumerate(planes):
        # From texture pixels to the plane, to the camera, to the image. OpenCV's pixel centres are at whole numbers.
        plane = np.array([[side / 512, 0, x - side / 2], [0, side / 512, -side / 2], [0, 0, depth], [0, 0, 1.0]])
        homography = k @ camera_from_world[:3] @ plane
        half = np.array([[1, 0, 0.5], [0, 1, 0.5], [0, 0, 1.0]])
        homography = np.linalg.inv(half) @ homography @ half
        seen = cv2.warpPerspective(texture(number), homography, (width, height), flags=cv2.INTER_AREA)
        mask = cv2.warpPerspective(np.full((512, 512), 255, np.uint8), homography, (width, height))
        image[mask > 127] = seen[mask > 127]
    return image


PLANES = [(0.0, 5.0, 9.0), (-0.9, 3.4, 1.1), (1.0, 2.9, 0.9), (0.1, 2.4, 0.6)]


def poses_of(count: int) -> np.ndarray:
    """Cameras 0.3 m apart that turn towards the middle, by 4 degrees each."""
    found = []
    for index in range(count):
        angle = np.radians(-4.0 * index)
        pose = np.eye(4)
        pose[:3, :3] = cv2.Rodrigues(np.array([0.02 * index, angle, 0.0]))[0]
        pose[:3, 3] = [0.3 * index, 0.02 * index, 0.05 * index]
        found.append(pose)
    return np.stack(found)


def take(
    folder: Path,
    poses: np.ndarray,
    planes: list[tuple[float, float, float]] = PLANES,
    focal: Callable[[int], float] = lambda index: FOCAL,
) -> Taken:
    """Write the photos of some cameras, p0.png and so on; `focal` gives the focal length of each."""
    folder.mkdir(parents=True, exist_ok=True)
    for index, pose in enumerate(poses):
        write_png(folder / f"p{index}.png", picture(pose, planes, focal(index)))
    return Taken(folder, poses)
