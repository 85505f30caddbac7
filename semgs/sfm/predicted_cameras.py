"""From photos and a file of predicted cameras and depth to a folder that is a scene, without COLMAP."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from semgs.data.cameras.lens import Lens
from semgs.data.frames import Frame
from semgs.data.scenes import open_predictions
from semgs.files.atomic import write_bytes
from semgs.files.errors import InputError
from semgs.sfm.photos import pictures_in, upright_copy
from semgs.sfm.scale import KnownDistance, in_metres
from semgs.sfm.solving import PosedPhoto, Solution
from semgs.sfm.writing import IMAGES, write_transforms

MOST_POINTS = 20_000
"""Points of the predicted depth that are written."""


def write_predicted_scene(
    photos: Path, predictions: Path, folder: Path, distance: KnownDistance | None = None
) -> Solution:
    """Write photos with the cameras of a file, and points of its depth, into a folder that is a scene.

    Args:
        photos: the folder with the photos that the file was made from.
        predictions: the file, such as `predictions.npz`, or a folder with one.
        folder: an existing one, without `images` in it.
        distance: between two of the cameras; None keeps the file's unit of length.

    Raises:
        InputError: the file or the photos cannot be used, or do not fit one another.
        ValueError: the distance does not fit the photos.
        OSError: a file cannot be written.
    """
    pictures = pictures_in(photos)
    if not pictures:
        raise InputError(photos, "a folder with the photos that the predictions are of", "no photos")
    scene = open_predictions(predictions, pictures[0].parent)
    images = folder / IMAGES
    images.mkdir()
    posed, points, colours = [], [], []
    for frame in scene.frames:
        pixels = frame.read_image()
        assert isinstance(frame.picture, Path)
        assert isinstance(frame.lens, Lens)
        name, data = upright_copy(frame.picture, pixels, pictures)
        write_bytes(images / name, data)
        posed.append(PosedPhoto(name, frame.lens, frame.world_from_camera, frame.picture.name))
        places, inside = _points(frame, MOST_POINTS // len(scene))
        points.append(places)
        colours.append(pixels[inside[:, 0], inside[:, 1]])
    solution = Solution(tuple(posed), np.concatenate(points), np.concatenate(colours), None, scene.unit, scene.notes)
    if distance is not None:
        solution = in_metres(solution, distance)
    write_transforms(folder, solution)
    return solution


def _points(frame: Frame, most: int) -> tuple[np.ndarray, np.ndarray]:
    """About so many points [n 3] of a frame's depth in the world, and their pixels [n 2] as (row, column)."""
    depth = frame.measured()
    if depth is None:
        return np.zeros((0, 3)), np.zeros((0, 2), np.int64)
    step = max(1, round((depth.size / max(1, most)) ** 0.5))
    inside = np.argwhere(depth[step // 2 :: step, step // 2 :: step] > 0) * step + step // 2
    depths = depth[inside[:, 0], inside[:, 1]].astype(np.float64)[:, None]
    pixels = np.column_stack((inside[:, 1] + 0.5, inside[:, 0] + 0.5, np.ones(len(inside))))
    pose = frame.world_from_camera
    return pixels @ np.linalg.inv(frame.lens.intrinsics).T * depths @ pose[:3, :3].T + pose[:3, 3], inside
