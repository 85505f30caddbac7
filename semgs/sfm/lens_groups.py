"""Photos of one size that were taken with several lenses or zooms, which nothing but the photos themselves says.

COLMAP gets one camera for photos of one size. If each has a camera of its own instead, their focal lengths show which belong together.
"""

from __future__ import annotations

import sqlite3
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from semgs.files.text import listed
from semgs.sfm.photos import UprightPhoto
from semgs.sfm.pycolmap_library import pycolmap

FEWEST = 4
"""Fewer photos do not show a focal length for each."""

SAME = 1.2
"""Focal lengths that differ by less than this factor from the next one are of one lens."""

BETTER = 0.85
"""Several focal lengths are believed if the reprojection error falls to this share."""

_FOUND = ("keypoints", "descriptors", "matches", "two_view_geometries")
"""Tables of what was found in images, by their ids."""


def may_be_several(upright: Sequence[UprightPhoto], ordered: bool) -> bool:
    """Whether photos may have focal lengths of which EXIF says nothing. The frames of a clip have one."""
    return not ordered and sum(photo.focal_px is None for photo in upright) >= FEWEST


def group_by_focal(model: Any, upright: Sequence[UprightPhoto]) -> dict[str, tuple]:
    """The group of each photo, from a model in which each has a camera of its own: photos of one size and one focal length.

    Photos that EXIF knows the focal length of are grouped by that; photos that are not in the model go to the largest group of their size.
    """
    focal = {
        image.name: float(model.cameras[image.camera_id].params[0]) for image in model.images.values() if image.has_pose
    }
    groups: dict[str, tuple] = {}
    for size in dict.fromkeys(photo.size for photo in upright):
        names = [one.name for one in upright if one.size == size and one.focal_px is None]
        known = sorted((focal[name], name) for name in names if name in focal)
        number, before, members = -1, 0.0, list[list[str]]()
        for value, name in known:
            if value > SAME * before:
                number += 1
                members.append([])
            members[number].append(name)
            before = value
        largest = max(range(len(members)), key=lambda index: len(members[index]), default=0)
        for index, group in enumerate(members):
            groups |= {name: (size, None, index) for name in group}
        groups |= {name: (size, None, largest) for name in names if name not in groups}
    groups |= {one.name: (one.size, one.focal_px) for one in upright if one.focal_px is not None}
    return groups


def describe_groups(posed: Sequence[Any], groups: Mapping[str, tuple]) -> str:
    """A note that says which photos have which focal length."""
    focal: dict[tuple, list[Any]] = {}
    for photo in posed:
        focal.setdefault(groups[photo.name], []).append(photo)
    parts = sorted(focal.values(), key=len)
    said = [f"{np.median([one.lens.focal[0] for one in part]):.0f} px for {_named(part)}" for part in parts[:-1]]
    rest = f"{np.median([one.lens.focal[0] for one in parts[-1]]):.0f} px for the other {len(parts[-1])}"
    return (
        f"The photos have {len(parts)} focal lengths, as if taken with several lenses or zooms, and each group of photos has its own: {', '.join(said)}, "
        f"{rest}."
    )


def copy_with_cameras(
    old: Path, new: Path, folder: Path, groups: Mapping[str, tuple], focal: Mapping[tuple, float]
) -> None:
    """Copy COLMAP's database with other cameras: one for each group of photos.

    Args:
        old: the database, with features and matches.
        new: where to write the copy.
        folder: of the photos.
        groups: of each photo.
        focal: where to start, of groups whose focal length is not known [px].
    """
    library = pycolmap()
    with library.Database.open(old) as held:
        images = sorted(held.read_all_images(), key=lambda image: image.image_id)
        cameras = {camera.camera_id: camera for camera in held.read_all_cameras()}
    library.Database.open(new).close()
    made: dict[tuple, int] = {}
    for image in images:
        group, camera = groups[image.name], cameras[image.camera_id]
        options = library.ImageReaderOptions()
        options.camera_model = camera.model.name
        values = [focal.get(group, camera.params[0]), *camera.params[1:]]
        options.camera_params = ",".join(f"{value}" for value in values)
        options.existing_camera_id = made.get(group, -1)
        mode = library.CameraMode.AUTO if group in made else library.CameraMode.SINGLE
        library.import_images(new, folder, mode, [image.name], options)
        with library.Database.open(new) as copy:
            number = copy.read_image_with_name(image.name).camera_id
            if group not in made:
                written = copy.read_camera(number)
                written.has_prior_focal_length = camera.has_prior_focal_length
                copy.update_camera(written)
            made[group] = number
    connection = sqlite3.connect(new)
    try:
        connection.execute("ATTACH ? AS old", (str(old),))
        for table in _FOUND:
            connection.execute(f"INSERT INTO {table} SELECT * FROM old.{table}")
        connection.commit()
    finally:
        connection.close()


def _named(photos: Sequence[Any]) -> str:
    """The names of some photos, at most five."""
    return listed([photo.name for photo in photos])
