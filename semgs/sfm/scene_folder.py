"""From photos or a clip to a folder that is a scene: upright images with estimated cameras."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

from semgs.runtime.cores import usable_cores
from semgs.runtime.notes import Kind
from semgs.sfm.clips import copy_frames
from semgs.sfm.photos import copy_photos, with_focal
from semgs.sfm.pycolmap_library import pycolmap
from semgs.sfm.scale import KnownDistance, in_metres
from semgs.sfm.solving import Solution, expected_seconds, solve
from semgs.sfm.writing import IMAGES, write_colmap, write_transforms

ESTIMATING = Kind(
    "Estimating the cameras of {count} photos: about {seconds:.0f} s",
    "Finding where the {count} photos were taken (about {seconds:.0f} s)",
)


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
