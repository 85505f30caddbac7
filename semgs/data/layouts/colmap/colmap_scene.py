"""COLMAP models: `cameras`, `images` and perhaps `points3D`, binary or text, with the images next to them.

The unit of length is arbitrary. `semgs.data.layouts.colmap.colmap_files` describes the format and its conventions.
"""

from __future__ import annotations

from collections.abc import Collection, Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np

from semgs.data.cameras.lens import AbstractLens
from semgs.data.confined import may_read, named_file
from semgs.data.frames import Frame
from semgs.data.layouts.colmap.colmap_files import ColmapPoints, read_cameras, read_images, read_points
from semgs.data.layouts.parts.letter_forms import OTHER_FORM, in_other_form
from semgs.data.layouts.parts.pose_files import checked_poses
from semgs.data.layouts.parts.usable_frames import note_damaged_points, note_lacking, note_transparent
from semgs.data.maps import MaskMap
from semgs.data.scene import Scene
from semgs.data.scene_details import SceneDetails
from semgs.files.errors import InputError
from semgs.files.images.pictures import is_turned, read_header
from semgs.files.text import composed, counted, listed

PLACES = ("sparse/0", "sparse", "colmap/sparse/0", "distorted/sparse/0", "")
"""Places of a model below the folder of a scene; the last one is the folder itself."""

PICTURE_FOLDERS = ("images", "input_images", "input", "dataset")
"""Names of folders with the images; the second has the frames that Depth Anything 3 takes from a video, the third the photos before 3D Gaussian splatting
undistorts them, the last hloc's."""

REDUCED = {"images_2": 2, "images_4": 4, "images_8": 8}
"""Folders of reduced images, as nerfstudio and 3D Gaussian splatting have them, by what their sides were divided by."""

MASKS = "masks"
"""The folder beside the images with what COLMAP was told to leave out: `a.jpg.png` for `a.jpg`, black where it is hidden."""

ENDINGS = (".jpg", ".jpeg", ".png")
"""Endings of images that were converted after COLMAP saw them, in lower case."""

DISTORTED = "distorted"
"""The folder of a model of 3D Gaussian splatting whose images are still in `input`; those in `images` are undistorted."""

ABOVE = 4
"""So many folders above the model are searched for the images."""

MOST_TRIED = 1000
"""Of so many names, it is looked up in which folder the images are."""

MOST_NAMED = 4
"""So many of these folders are named if there are no images."""

DETAILS = ("images",)


POINTS_FOR_DEPTH = 50_000
"""In larger models, only every n-th point is matched with the frames that see it: enough for near and far."""


def recognises(path: Path) -> bool:
    """Whether a path is a folder with a COLMAP model."""
    return _model(path) is not None


def open_colmap(path: Path, details: SceneDetails) -> Scene:
    """The scene of a COLMAP model; frames are in the order of their names.

    Args:
        path: the folder that contains `sparse` and `images`, or the folder of the model.
        details: may give the folder of the images.

    Raises:
        InputError: the model is damaged, a camera model is not supported, fewer than two images are there, or one has another
            size than its camera.
    """
    model = _model(path) or path
    ending = _ending(model) or ".bin"
    file = model / f"cameras{ending}"
    cameras = read_cameras(file)
    lenses = {number: camera.lens(file, f"camera {number}") for number, camera in cameras.items()}
    list_file = model / f"images{ending}"
    images = sorted(read_images(list_file, cameras), key=lambda image: image.name)
    poses = checked_poses(list_file, [image.world_from_camera for image in images], [image.place for image in images])
    points, damage = _points(model / f"points3D{ending}", {image.number for image in images})
    searched = _searched(model) if details.images is None else [details.images]
    pictures = _pictures_folder(list_file, searched, [image.name for image in images])
    known: dict[Path, dict[str, list[Path]]] = {}
    frames, absent, renamed, transparent = [], [], [], 0
    for image, pose in zip(images, poses, strict=True):
        picture = _picture(list_file, pictures, image.name)
        if picture is None:
            picture = _renamed(list_file, pictures, image.name, known)
            renamed += [] if picture is None else [image.name]
        if picture is None:
            absent.append(image.name)
            continue
        header = read_header(picture)
        lens = _reduced(lenses[image.camera], header.size, REDUCED.get(pictures.name, 1))
        is_turned(picture, header, lens.size)
        transparent += header.transparent
        seen = points.seen.get(image.number, np.zeros(0, np.int64))
        name = image.name if (pictures / image.name).is_file() else image.name.replace("\\", "/")
        mask = named_file(list_file, pictures.parent / MASKS, f"{name}.png")
        frames.append(Frame(name, picture, lens, pose, points=seen, mask=MaskMap(mask) if mask.is_file() else None))
    if len(frames) < 2 and absent:
        found = f"{len(frames)} ({len(images)} listed, {len(absent)} without their image)"
        places = listed([str(one) for one in searched if one.is_dir()], MOST_NAMED)
        advice = (
            f"the first missing one is {absent[0]}, looked for in {places}; name the folder of the images with --images"
        )
        raise InputError(model, "at least two usable frames", found, advice=advice)
    return Scene(
        path=model,
        name=pictures.parent.absolute().name
        if pictures.name in (*PICTURE_FOLDERS, *REDUCED)
        else pictures.absolute().name,
        layout="COLMAP",
        unit="unknown",
        frames=tuple(frames),
        absent=tuple(absent),
        notes=(
            *_notes(model, pictures, absent, len(images), transparent),
            *note_lacking(
                renamed, len(images), f"images have another ending, other capitals or {OTHER_FORM} than the model says"
            ),
            *note_damaged_points(damage),
        ),
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


def _picture(file: Path, folder: Path, name: str) -> Path | None:
    """The image with a name, None if there is no such file. Names made on Windows have backslashes; if a name was Latin-1, the file name may still have these bytes."""
    bytewise = name.encode("latin-1", "ignore").decode("utf-8", "surrogateescape")
    names = (name, name.replace("\\", "/"), bytewise, bytewise.replace("\\", "/"))
    places = (named_file(file, folder, one) for one in dict.fromkeys(names))
    return next((one for one in places if one.is_file()), None)


def _renamed(file: Path, folder: Path, name: str, known: dict[Path, dict[str, list[Path]]]) -> Path | None:
    """The image with a name but for its ending, capitals and form of letters, None if there is none or several; `known` keeps what is in each folder."""
    name = name.replace("\\", "/")
    if (same := in_other_form(file, folder, name)) is not None:
        return same
    wanted = named_file(file, folder, name)
    if wanted.parent not in known:
        stems: dict[str, list[Path]] = {}
        for one in wanted.parent.iterdir() if wanted.parent.is_dir() else ():
            if one.suffix.lower() in ENDINGS:
                stems.setdefault(composed(one.stem).lower(), []).append(one)
        known[wanted.parent] = stems
    found = known[wanted.parent].get(composed(wanted.stem).lower(), [])
    return named_file(file, wanted.parent, found[0].name) if len(found) == 1 else None


def _reduced(lens: AbstractLens, size: tuple[int, int], factor: int) -> AbstractLens:
    """The lens of images whose sides were divided by a factor, if their size [px] is about that."""
    if factor == 1 or any(abs(side - whole / factor) >= 1 for side, whole in zip(size, lens.size, strict=True)):
        return lens
    down, across = (side / whole for side, whole in zip(size, lens.size, strict=True))
    (fx, fy), (cx, cy) = lens.focal, lens.centre
    return replace(lens, size=size, focal=(across * fx, down * fy), centre=(across * cx, down * cy))


def _searched(model: Path) -> list[Path]:
    """The folders that image names may be relative to: `images` and the like next to the model or above it, then these folders themselves, then others in them."""
    around = [model, *filter(may_read, model.absolute().parents[:ABOVE])]
    names: tuple[str, ...] = PICTURE_FOLDERS
    if DISTORTED in (one.name for one in around):
        names = ("input", *(name for name in names if name != "input"))
    return [
        *(one / name for one in around for name in names),
        *around,
        *(one / name for one in around for name in REDUCED),
    ]


def _pictures_folder(file: Path, searched: Sequence[Path], names: Sequence[str]) -> Path:
    """The first of some folders that has an image, or else its first image with another ending, capitals or form of letters; if none has one, the first that exists."""
    there = [folder for folder in searched if folder.is_dir()]
    some = names[:: 1 + len(names) // MOST_TRIED]
    for folder in there:
        if any(_picture(file, folder, name) for name in some):
            return folder
    for folder in there:
        if any(_renamed(file, folder, name, {}) for name in names[:1]):
            return folder
    return next(iter(there), searched[0])


def _notes(model: Path, pictures: Path, absent: Sequence[str], count: int, transparent: int) -> list[str]:
    """What the user should know about a model."""
    notes = [
        "COLMAP's unit of length is arbitrary, so depths are not in metres.",
        *note_lacking(absent, count, f"images of the model are missing in {pictures}"),
        *note_transparent(transparent, f"{MASKS}/a.png.png beside {pictures.name}/ for {pictures.name}/a.png"),
    ]
    others = [one for one in sorted(model.parent.iterdir()) if one.name.isdigit() and one != model]
    if others and model.name == "0":
        counts = {one: _count_images(one) for one in others}
        largest = max(others, key=lambda one: counts[one])
        more = f" {largest.name} has more: name {largest} to read it." if counts[largest] > count else ""
        also = ", ".join(f"{one.name} ({counts[one]})" for one in others)
        notes.append(f"COLMAP made several models; only 0 ({counted(count, 'image')}) is read, not {also}.{more}")
    return notes


def _count_images(model: Path) -> int:
    """The number of images of a model, 0 if it cannot be read."""
    ending = _ending(model)
    try:
        return len(read_images(model / f"images{ending}", read_cameras(model / f"cameras{ending}"))) if ending else 0
    except InputError:
        return 0
