"""COLMAP models: `cameras`, `images` and `points3D`, text or binary, read by pycolmap.

Poses are world to camera with OpenCV axes, intrinsics pixels with the centre of the first pixel at (0.5, 0.5), as ours. Lengths
are in a unit of COLMAP's choice. https://colmap.github.io/format.html
"""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np

from semgs.data.frames import Frame
from semgs.data.layouts.colmap_files import check_complete
from semgs.data.layouts.poses import checked_poses
from semgs.data.lens import Lens
from semgs.data.scene import Scene
from semgs.files.errors import InputError
from semgs.files.pictures import is_turned, read_header

PLACES = ("sparse/0", "sparse", "colmap/sparse/0", "")
"""Where a model is, below the folder of a scene; the last one is the folder itself."""

LOOKED_FOR = "a COLMAP model (cameras, images and points3D, .bin or .txt) in " + ", ".join(
    f"{p or '.'}/" for p in PLACES
)

MODELS = {
    "SIMPLE_PINHOLE": ("f", "cx", "cy"),
    "PINHOLE": ("fx", "fy", "cx", "cy"),
    "SIMPLE_RADIAL": ("f", "cx", "cy", "k1"),
    "RADIAL": ("f", "cx", "cy", "k1", "k2"),
    "OPENCV": ("fx", "fy", "cx", "cy", "k1", "k2", "p1", "p2"),
}
"""The camera models that are read, and what their parameters are."""

POINTS_FOR_DEPTH = 50_000
"""Of larger models every n-th point tells which frames see it: enough for near and far of any frame."""


def recognises(path: Path) -> bool:
    """Whether a path is a folder with a COLMAP model."""
    return _model(path) is not None


def open_model(path: Path) -> Scene:
    """The scene of a COLMAP model; frames are in the order of their names.

    Args:
        path: the folder above `sparse`, with `images` beside it; or the model's own folder.

    Raises:
        InputError: the model is damaged, a camera is not one of `MODELS`, fewer than two pictures are there, or one has another
            size than its camera.
        ImportError: pycolmap is not installed.
    """
    model = _model(path) or path
    check_complete(model)
    reconstruction = _reconstruction(model)
    images = sorted((image for image in reconstruction.images.values() if image.has_pose), key=lambda image: image.name)
    lenses = {key: _lens(model, camera) for key, camera in reconstruction.cameras.items()}
    poses = checked_poses(
        model, [_world_from_camera(image) for image in images], [f"image {one.name}" for one in images]
    )
    points, sightings = _points(reconstruction)
    pictures = _pictures_folder(model, [image.name for image in images])
    frames, absent, transparent = [], [], 0
    for image, pose in zip(images, poses, strict=True):
        picture = pictures / image.name
        if not picture.is_file():
            absent.append(image.name)
            continue
        lens = lenses[image.camera_id]
        header = read_header(picture)
        is_turned(picture, header, lens.size)
        transparent += header.transparent
        seen = np.array(sightings.get(image.image_id, ()), dtype=np.int64)
        frames.append(Frame(image.name, picture, lens, pose, points=seen))
    return Scene(
        path=model,
        name=pictures.parent.absolute().name if pictures.name == "images" else pictures.absolute().name,
        layout="COLMAP",
        unit="unknown",
        frames=tuple(frames),
        absent=tuple(absent),
        notes=tuple(_notes(model, pictures, absent, len(images), transparent)),
        points=points if len(points) else None,
    )


def _model(path: Path) -> Path | None:
    """The folder of the model that belongs to a path."""
    for place in PLACES:
        folder = path / place
        if any(all((folder / f"{name}.{kind}").is_file() for name in ("cameras", "images")) for kind in ("bin", "txt")):
            return folder
    return None


def _reconstruction(model: Path) -> Any:
    """The model as pycolmap reads it.

    Raises:
        ImportError: pycolmap is not installed.
        InputError: it cannot be read.
    """
    try:
        import pycolmap
    except ImportError as error:
        raise ImportError(
            f'{model} is a COLMAP model; reading it needs pycolmap: pip install "semgs[sfm]"', name="pycolmap"
        ) from error
    try:
        return pycolmap.Reconstruction(str(model))
    except Exception as error:  # whatever pycolmap raises on a damaged model: ValueError, IndexError, RuntimeError
        raise InputError(model, "a COLMAP model", f"one that pycolmap cannot read: {error}") from error


def _lens(model: Path, camera: Any) -> Lens:
    """The lens of a COLMAP camera.

    Raises:
        InputError: its model is not one of `MODELS`, or its numbers make no camera.
    """
    key = f"camera {camera.camera_id}"
    name = camera.model.name
    if name not in MODELS:
        raise InputError(
            model,
            "a camera model of " + ", ".join(MODELS),
            name,
            key,
            "undistort with `colmap image_undistorter` first",
        )
    values = dict(zip(MODELS[name], (float(value) for value in camera.params), strict=True))
    focal = values.get("fx", values.get("f", 0.0)), values.get("fy", values.get("f", 0.0))
    try:
        return Lens(
            size=(int(camera.height), int(camera.width)),
            focal=focal,
            centre=(values["cx"], values["cy"]),
            distortion=(
                values.get("k1", 0.0),
                values.get("k2", 0.0),
                values.get("p1", 0.0),
                values.get("p2", 0.0),
                0.0,
            ),
        )
    except ValueError as error:
        raise InputError(model, "a camera that can be", str(error), key) from error


def _world_from_camera(image: Any) -> np.ndarray:
    """The pose of a COLMAP image, camera to world."""
    pose = np.eye(4)
    pose[:3] = image.cam_from_world().inverse().matrix()
    return pose


def _points(reconstruction: Any) -> tuple[np.ndarray, dict[int, list[int]]]:
    """The sparse points [n 3], and for each image id which of them it sees."""
    points = list(reconstruction.points3D.values())
    positions = np.array([point.xyz for point in points], dtype=np.float64).reshape(-1, 3)
    sightings: dict[int, list[int]] = {}
    for index in range(0, len(points), 1 + len(points) // POINTS_FOR_DEPTH):
        for image_id in {element.image_id for element in points[index].track.elements}:
            sightings.setdefault(image_id, []).append(index)
    return positions, sightings


def _pictures_folder(model: Path, names: Sequence[str]) -> Path:
    """The folder that the images' names are relative to: `images` beside the model or above it, or the model's own."""
    around = [model, *model.absolute().parents[:3]]
    for folder in [*(one / "images" for one in around), *around]:
        if any((folder / name).is_file() for name in names):
            return folder
    return next((one / "images" for one in around if (one / "images").is_dir()), model)


def _notes(model: Path, pictures: Path, absent: Sequence[str], count: int, transparent: int) -> list[str]:
    """What the user should be told about a model."""
    notes = ["COLMAP's unit of length is arbitrary, so depths are without metres."]
    if absent:
        notes.append(
            f"{len(absent)} of the model's {count} pictures are absent in {pictures}, the first is {absent[0]}."
        )
    if transparent:
        notes.append(f"{transparent} pictures have an alpha channel; where transparent they are laid on white.")
    others = (
        [one.name for one in sorted(model.parent.iterdir()) if one.name.isdigit() and one != model]
        if model.name == "0"
        else []
    )
    if others:
        notes.append(f"COLMAP made several models; 0 is read, not {', '.join(others)}.")
    return notes
