"""COLMAP models: `cameras`, `images` and perhaps `points3D`, binary or text, with the images next to them.

The unit of length is arbitrary. `semgs.data.layouts.colmap.colmap_files` describes the format and its conventions.
"""

from __future__ import annotations

from collections.abc import Collection, Sequence
from pathlib import Path

import numpy as np

from semgs.data.frames import Frame
from semgs.data.layouts.colmap.colmap_files import PARAMETERS, ColmapPoints, read_cameras, read_images, read_points
from semgs.data.layouts.parts.pose_files import checked_poses
from semgs.data.layouts.parts.sentences import note_damaged_points, note_lacking, note_transparent
from semgs.data.scene import Scene
from semgs.files.errors import InputError
from semgs.files.images.pictures import is_turned, read_header

PLACES = ("sparse/0", "sparse", "colmap/sparse/0", "")
"""Places of a model below the folder of a scene; the last one is the folder itself."""

PICTURE_FOLDERS = ("images", "input_images")
"""Names of folders with the images; the second has the frames that Depth Anything 3 takes from a video."""

LOOKED_FOR = "a COLMAP model (cameras, images and points3D, .bin or .txt) in " + ", ".join(
    f"{p or '.'}/" for p in PLACES
)

POINTS_FOR_DEPTH = 50_000
"""In larger models, only every n-th point is matched with the frames that see it: enough for near and far."""


def recognises(path: Path) -> bool:
    """Whether a path is a folder with a COLMAP model."""
    return _model(path) is not None


def open_colmap(path: Path) -> Scene:
    """The scene of a COLMAP model; frames are in the order of their names.

    Args:
        path: the folder that contains `sparse` and `images`, or the folder of the model.

    Raises:
        InputError: the model is damaged, a camera model is not supported, fewer than two images are there, or one has another
            size than its camera.
    """
    model = _model(path) or path
    ending = _ending(model) or ".bin"
    file = model / f"cameras{ending}"
    cameras = read_cameras(file, PARAMETERS)
    lenses = {number: camera.lens(file, f"camera {number}") for number, camera in cameras.items()}
    listed = model / f"images{ending}"
    images = sorted(read_images(listed, cameras), key=lambda image: image.name)
    poses = checked_poses(listed, [image.world_from_camera for image in images], [image.place for image in images])
    points, damage = _points(model / f"points3D{ending}", {image.number for image in images})
    pictures = _pictures_folder(model, [image.name for image in images])
    frames, absent, transparent = [], [], 0
    for image, pose in zip(images, poses, strict=True):
        picture = _picture(pictures, image.name)
        if picture is None:
            absent.append(image.name)
            continue
        lens = lenses[image.camera]
        header = read_header(picture)
        is_turned(picture, header, lens.size)
        transparent += header.transparent
        seen = points.seen.get(image.number, np.zeros(0, np.int64))
        frames.append(Frame(image.name, picture, lens, pose, points=seen))
    return Scene(
        path=model,
        name=pictures.parent.absolute().name if pictures.name in PICTURE_FOLDERS else pictures.absolute().name,
        layout="COLMAP",
        unit="unknown",
        frames=tuple(frames),
        absent=tuple(absent),
        notes=(*_notes(model, pictures, absent, len(images), transparent), *note_damaged_points(damage)),
        points=points.positions if len(points.positions) else None,
    )


def _model(path: Path) -> Path | None:
    """The folder of the model at a path, None if there is none."""
    return next((path / place for place in PLACES if _ending(path / place)), None)


def _ending(folder: Path) -> str | None:
    """The ending of the model's files in a folder, None if there is no model."""
    kinds = (".bin", ".txt")
    return next(
        (kind for kind in kinds if all((folder / f"{one}{kind}").is_file() for one in ("cameras", "images"))), None
    )


def _points(path: Path, images: Collection[int]) -> tuple[ColmapPoints, InputError | None]:
    """The sparse points of a model, empty if it has no such file; or empty, too, and why they cannot be read."""
    none = ColmapPoints(np.zeros((0, 3)), {})
    try:
        return (read_points(path, images, POINTS_FOR_DEPTH) if path.is_file() else none), None
    except InputError as error:
        return none, error


def _picture(folder: Path, name: str) -> Path | None:
    """The image with a name, None if there is no such file. If the name was Latin-1, the file name may still have these bytes."""
    names = (name, name.encode("latin-1", "ignore").decode("utf-8", "surrogateescape"))
    return next((folder / one for one in names if (folder / one).is_file()), None)


def _pictures_folder(model: Path, names: Sequence[str]) -> Path:
    """The folder that image names are relative to: `images` next to the model or above it, or the folder of the model."""
    around = [model, *model.absolute().parents[:3]]
    inside = [one / folder for one in around for folder in PICTURE_FOLDERS]
    for folder in [*inside, *around]:
        if any(_picture(folder, name) for name in names):
            return folder
    return next((one for one in inside if one.is_dir()), model)


def _notes(model: Path, pictures: Path, absent: Sequence[str], count: int, transparent: int) -> list[str]:
    """What the user should know about a model."""
    notes = [
        "COLMAP's unit of length is arbitrary, so depths are not in metres.",
        *note_lacking(absent, count, f"images of the model are missing in {pictures}"),
        *note_transparent(transparent),
    ]
    others = [one.name for one in sorted(model.parent.iterdir()) if one.name.isdigit() and one != model]
    if others and model.name == "0":
        notes.append(f"COLMAP made several models; only 0 is read, not {', '.join(others)}.")
    return notes
