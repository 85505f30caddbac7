"""From photos or a clip to a folder that is a scene: upright images with cameras, which are estimated, or from a file of predictions.

The cameras are written as a `transforms.json` with sparse points, as nerfstudio has them, or as a COLMAP model. Both lie beside `images`.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from semgs.data.cameras.lens import Lens
from semgs.data.frames import Frame
from semgs.data.ply_tables import write_ply
from semgs.data.scenes import open_predictions
from semgs.files.atomic import write_bytes, write_json
from semgs.files.errors import InputError
from semgs.runtime.cores import usable_cores
from semgs.runtime.notes import Kind
from semgs.sfm.clips import copy_frames
from semgs.sfm.photos import copy_photos, pictures_in, upright_copy, with_focal
from semgs.sfm.pycolmap_library import pycolmap
from semgs.sfm.scale import KnownDistance, in_metres
from semgs.sfm.solving import PosedPhoto, Solution, expected_seconds, solve

ESTIMATING = Kind(
    "Estimating the cameras of {count} photos: about {seconds:.0f} s",
    "Finding where the {count} photos were taken (about {seconds:.0f} s)",
)

IMAGES, POINTS, MODEL = "images", "sparse_pc.ply", "sparse/0"

OPENGL_FROM_OPENCV = np.diag([1.0, -1.0, -1.0, 1.0])

MOST_POINTS = 20_000
"""Points of the predicted depth that are written."""


@dataclass(frozen=True)
class PhotoDetails:
    """What the user knows about photos.

    Attributes:
        focal_px: focal length in pixels of the full-size photos; None to take it from EXIF, or to solve for it.
        distance: between two of the cameras; None leaves the unit of length unknown.
        frames: the largest number of frames of a clip.
    """

    focal_px: float | None = None
    distance: KnownDistance | None = None
    frames: int = 24


def write_photo_scene(
    path: Path, folder: Path, known: PhotoDetails, say: Callable[[str], object] = print, *, colmap: bool = False
) -> Solution:
    """Estimate the cameras of photos, and write them with the photos into a folder that is a scene.

    Args:
        path: a folder of photos, or a clip.
        folder: an existing one, without `images` in it.
        known: what the user knows.
        say: takes a line about how long it takes, before it starts.
        colmap: write a COLMAP model instead of a `transforms.json`.

    Raises:
        InputError: the photos cannot be used, or their cameras cannot be estimated.
        ValueError: a detail that the user gave does not fit the photos.
        ImportError: pycolmap is not installed, or pillow-heif for a HEIC.
        OSError: a file cannot be written.
    """
    pycolmap()
    images = folder / IMAGES
    images.mkdir()
    photos = copy_frames(path, images, known.frames) if path.is_file() else copy_photos(path, images)
    listed = photos.photos if known.focal_px is None else with_focal(photos, known.focal_px)
    seconds = expected_seconds(listed, photos.ordered, usable_cores(), known.focal_px is not None)
    say(ESTIMATING(count=len(listed), seconds=seconds))
    solution = solve(photos, listed, known.focal_px is not None)
    if known.distance is not None:
        solution = in_metres(solution, known.distance)
    (write_colmap if colmap else write_transforms)(folder, solution)
    return solution


def write_transforms(folder: Path, solution: Solution) -> None:
    """Write `transforms.json` and `sparse_pc.ply`; camera axes are OpenGL's, the world is that of the solution.

    Raises:
        OSError: a file cannot be written.
    """
    columns = (*solution.points.T, *solution.colours.T)
    names = (*"xyz", "red", "green", "blue")
    write_ply(folder / POINTS, dict(zip(names, columns, strict=True)), text=True)
    content = {
        "camera_model": "OPENCV",
        "metric": solution.unit == "metric",
        "ply_file_path": POINTS,
        "frames": [_entry(photo) for photo in solution.photos],
    }
    write_json(folder / "transforms.json", content)


def write_colmap(folder: Path, solution: Solution) -> None:
    """Write `sparse/0` with cameras, images and points in COLMAP's binary format.

    Raises:
        OSError: a file cannot be written.
    """
    (folder / MODEL).mkdir(parents=True)
    solution.model.write_binary(folder / MODEL)


def _entry(photo: PosedPhoto) -> dict[str, Any]:
    """A photo in the list of frames."""
    height, width = photo.lens.size
    return {
        "file_path": f"{IMAGES}/{photo.name}",
        "w": width,
        "h": height,
        "fl_x": photo.lens.focal[0],
        "fl_y": photo.lens.focal[1],
        "cx": photo.lens.centre[0],
        "cy": photo.lens.centre[1],
        "k1": photo.lens.distortion[0],
        "transform_matrix": (photo.world_from_camera @ OPENGL_FROM_OPENCV).tolist(),
    }


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
