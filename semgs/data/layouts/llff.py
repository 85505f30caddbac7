"""Cameras of LLFF: `poses_bounds.npy` beside `images/`, as LLFF, NeRF's code and Neural 3D Video have it.

A row for each photo, in the order of their names: a 3x5 matrix row by row, then the nearest and the farthest depth. The matrix has the camera's axes in the
world, in the order down, right, backward; its position; and height, width and focal length of the photos [px]. The principal point is the middle.
Lengths are in COLMAP's unit, which is arbitrary. https://github.com/Fyusion/LLFF
"""

from __future__ import annotations

from pathlib import Path

import numpy as np

from semgs.data.cameras.lens import Lens
from semgs.data.frames import Frame
from semgs.data.layouts.parts.pose_files import checked_poses
from semgs.data.layouts.parts.usable_frames import pictures_in
from semgs.data.scene import Scene
from semgs.files.arrays import read_array
from semgs.files.errors import InputError, input_error
from semgs.files.images.pictures import is_turned, read_header

LAYOUT = "LLFF"
POSES, IMAGES = "poses_bounds.npy", "images"
COLUMNS = 17
ASPECT = 0.01
"""The aspect of photos may differ from that of their camera by this share; they may have another size."""


def recognises(path: Path) -> bool:
    """Whether a path is a folder with such a file and photos, or the file."""
    folder = path.parent if path.name == POSES else path
    return (folder / POSES).is_file() and _folder(folder) is not None


def open_llff(path: Path) -> Scene:
    """The scene of LLFF's poses; frames are in the order of their names.

    Args:
        path: the folder, or the file.

    Raises:
        InputError: the file is damaged, or there is another number of photos than of poses.
    """
    folder = path.parent if path.name == POSES else path
    file, place = folder / POSES, _folder(folder) or folder / IMAGES
    rows = read_array(file)
    if rows.ndim != 2 or rows.shape[1] != COLUMNS or rows.dtype.kind not in "fiu":
        raise InputError(file, f"an array [n {COLUMNS}] of numbers", f"{rows.dtype} {rows.shape}")
    pictures = pictures_in(place)
    if len(pictures) != len(rows):
        raise InputError(file, f"a pose for each of the {len(pictures)} images in {place.name}/", f"{len(rows)}")
    matrices = rows[:, :15].astype(np.float64).reshape(-1, 3, 5)
    poses = np.tile(np.eye(4), (len(rows), 1, 1))
    poses[:, :3] = np.stack((matrices[..., 1], matrices[..., 0], -matrices[..., 2], matrices[..., 3]), axis=-1)
    keys = [f"row {index}" for index in range(len(rows))]
    poses = checked_poses(file, list(poses), keys)
    lenses: dict[Lens, Lens] = {}
    frames = []
    for picture, pose, matrix, key in zip(pictures, poses, matrices, keys, strict=True):
        header = read_header(picture)
        is_turned(picture, header, header.size)
        (height, width), (rows_of, columns_of, focal) = header.size, matrix[:, 4].tolist()
        if not (rows_of > 0 and columns_of > 0) or abs(height * columns_of / (width * rows_of) - 1) > ASPECT:
            found = f"one for {columns_of:g}x{rows_of:g}"
            raise InputError(
                file,
                f"a camera for {width}x{height} (width x height), the size of {picture.name}, or larger ones",
                found,
                key,
            )
        with input_error(file, "a possible camera", key):
            lens = Lens(
                (height, width), (focal * width / columns_of, focal * height / rows_of), (width / 2, height / 2)
            )
        frames.append(Frame(f"{place.name}/{picture.name}", picture, lenses.setdefault(lens, lens), pose))
    return Scene(
        path=path,
        name=folder.absolute().name,
        layout=LAYOUT,
        unit="unknown",
        frames=tuple(frames),
        notes=("LLFF's unit of length is arbitrary, so depths are not in metres.",),
    )


def _folder(folder: Path) -> Path | None:
    """The folder of the photos, which LLFF sorts by name: `images`, or smaller copies of them (`images_4`)."""
    places = sorted(folder.glob(f"{IMAGES}_*"), key=lambda one: (len(one.name), one.name))
    return next((one for one in (folder / IMAGES, *places) if one.is_dir() and pictures_in(one)), None)
