"""Preparing scenes: any scene that can be opened becomes a compact `transforms.json` scene in one file.

Each scene is a zip archive without further compression, so `open_scene` reads it in place:

    transforms.json    nerfstudio's layout, metric if the source is; each frame keeps its name
    images/NAME.jpg    at one size
    depth/NAME.png     z-depth, 16 bits, millimetres
    labels/NAME.png    class per pixel, 8 bits, 255 = none
    masks/NAME.png     0 at hidden pixels, 255 elsewhere; only of images with some
    classes.json       the class table, if it is not one of semgs
    prepared.json      the source: layout, frames, notes, pixels of each class, terms, and the network that labels are from

Images of another aspect are cropped on two sides, so pixels stay square; differences of up to 1 % are stretched. Cameras are adjusted. The
bytes depend only on the source and the settings, not on the time or the number of processes.
"""

from __future__ import annotations

import io
import json
import re
import zipfile
from collections.abc import Callable, Sequence
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

import numpy as np

from semgs.data.frames import Frame
from semgs.data.maps import MILLIMETRE, SATURATED
from semgs.data.origin.licences import RECORD, labeller_of, terms_of_photos
from semgs.data.resampling import reframed
from semgs.data.scene import Scene
from semgs.data.spread import spread
from semgs.data.tables.class_files import class_file
from semgs.data.tables.classes import IGNORE, TABLES
from semgs.data.views import INDOOR_DEPTH_RANGE, Views
from semgs.files.atomic import new_file
from semgs.files.errors import InputError
from semgs.files.images.pictures import jpeg_bytes, png_bytes

OWN_TABLE = "classes.json"
"""The file of a class table that is not one of semgs."""
_MIDNIGHT = (1980, 1, 1, 0, 0, 0)
"""The time of every member: the earliest that a zip archive can store."""


@dataclass(frozen=True)
class Preparation:
    """The settings for preparing scenes.

    Attributes:
        size: (height, width) of landscape images; swapped for portrait images [px].
        every: keep every n-th usable frame, from the first.
        quality: of the JPEGs, 1 to 95.
        version: of semgs, for the record.

    Raises:
        ValueError: a value is out of range.
    """

    size: tuple[int, int] = (240, 320)
    every: int = 1
    quality: int = 92
    version: str = ""

    def __post_init__(self) -> None:
        if min(self.size) < 1 or self.every < 1 or not 1 <= self.quality <= 95:
            raise ValueError(
                f"size is {self.size}, every {self.every} and quality {self.quality}; "
                "expected positive sides, 1 or more and 1 to 95"
            )

    def as_json(self) -> dict[str, Any]:
        """The settings for JSON files, with the version of semgs."""
        return {"semgs": self.version, "size": list(self.size), "every": self.every, "quality": self.quality}


def prepare_scene(
    scene: Scene, target: Path, settings: Preparation, *, done: Callable[[int], None] | None = None
) -> dict[str, Any]:
    """Write a scene atomically as one zip archive.

    Args:
        scene: the scene.
        target: the archive to write; an existing one is replaced.
        settings: how to prepare it.
        done: called after each frame with the number of frames written.

    Returns:
        The content of `prepared.json` in the archive.

    Raises:
        InputError: a file of the scene cannot be used, or fewer than two frames are kept.
        OSError: the disk is full.
    """
    frames = _kept(scene, settings)
    with new_file(target) as file:
        return _fill(file, scene, frames, settings, done)


def estimate_bytes(scene: Scene, settings: Preparation, sample: int = 3) -> int:
    """Estimate the size of a scene's archive in bytes, from some of its frames.

    Raises:
        InputError: a file of the scene cannot be used, or fewer than two frames are kept.
    """
    frames = _kept(scene, settings)
    few = spread(frames, sample)
    trial = io.BytesIO()
    _fill(trial, scene, few, settings)
    return round(trial.tell() / len(few) * len(frames))


def _kept(scene: Scene, settings: Preparation) -> tuple[Frame, ...]:
    """The frames to keep, at least two."""
    frames = scene.frames[:: settings.every]
    if len(frames) < 2:
        raise InputError(scene.path, "at least two frames to keep", f"{len(frames)} of {len(scene)}", "every")
    return frames


def _fill(
    file: io.BufferedIOBase,
    scene: Scene,
    frames: Sequence[Frame],
    settings: Preparation,
    done: Callable[[int], None] | None = None,
) -> dict[str, Any]:
    """Write the archive of some frames; returns its record."""
    pixels = np.zeros(IGNORE + 1, np.int64)
    listed: list[dict[str, Any]] = []
    with zipfile.ZipFile(file, "w") as archive:
        for frame, stem in zip(frames, _stems(frames), strict=True):
            view = read_prepared_view(scene, frame, settings.size)
            listed.append(_write_frame(archive, frame, stem, view, scene, settings))
            if view.labels is not None:
                pixels += np.bincount(view.labels.numpy().ravel(), minlength=IGNORE + 1)
            if done is not None:
                done(len(listed))
        record = _record(scene, listed, pixels, settings)
        _write(archive, "transforms.json", _json(_transforms(scene, listed)))
        if scene.classes is not None and scene.classes not in TABLES:
            _write(archive, OWN_TABLE, _json(class_file(scene.classes)))
        _write(archive, RECORD, _json(record))
    return record


def read_prepared_view(scene: Scene, frame: Frame, size: tuple[int, int]) -> Views:
    """One prepared frame: cropped to the aspect of `size` and resized. For portrait images, `size` is swapped.

    Args:
        scene: of the frame.
        frame: to read.
        size: the new (height, width) [px].

    Raises:
        InputError: a file of the frame cannot be used.
    """
    view = frame.view(INDOOR_DEPTH_RANGE, scene.classes).checked()
    rows, columns = view.size
    height, width = size if (rows <= columns) == (size[0] <= size[1]) else size[::-1]
    return reframed(view, (height, width))


def fingerprint(scene: Scene) -> dict[str, Any]:
    """A fingerprint of a scene, to detect changes: its frames, maps and cameras."""
    return {
        "layout": scene.layout,
        "unit": scene.unit,
        "frames": len(scene),
        "first": scene.frames[0].name,
        "last": scene.frames[-1].name,
        "depths": sum(frame.depth is not None for frame in scene.frames),
        "labels": sum(frame.labels is not None for frame in scene.frames) if scene.classes else 0,
        "focal": [round(side, 6) for side in scene.frames[0].lens.focal],
        "centre": [round(side, 6) for side in scene.frames[0].lens.centre],
        "pose": [round(float(value), 6) for value in scene.frames[-1].world_from_camera[:3].ravel()],
    }


def _stems(frames: Sequence[Frame]) -> list[str]:
    """File names for the frames: the image name without folder and ending; with folders, or numbers, if that is not unique."""
    names = [frame.name.replace("\\", "/").rpartition(".")[0] or frame.name for frame in frames]
    names = [re.sub("[\ud800-\udfff]", "_", name) for name in names]  # not UTF-8, which archives need
    for choice in ([name.rpartition("/")[2] for name in names], [name.replace("/", "_") for name in names]):
        if len(set(choice)) == len(choice):
            return choice
    return [f"{index:06d}" for index in range(len(frames))]


def _write_frame(
    archive: zipfile.ZipFile, frame: Frame, stem: str, view: Views, scene: Scene, settings: Preparation
) -> dict[str, Any]:
    """Write the files of a frame; returns its entry in `transforms.json`."""
    picture = (view.images[0].permute(1, 2, 0) * 255).round().byte().numpy()
    _write(archive, f"images/{stem}.jpg", jpeg_bytes(picture, settings.quality))
    k = view.cameras.intrinsics[0].numpy()
    pose = view.cameras.world_from_camera[0].numpy().copy()
    pose[:3, 1:3] *= -1  # OpenGL axes
    entry: dict[str, Any] = {
        "file_path": f"images/{stem}.jpg",
        "source_name": frame.name,
        "w": view.size[1],
        "h": view.size[0],
        **{key: round(float(k[i, j]), 9) for key, i, j in (("fl_x", 0, 0), ("fl_y", 1, 1), ("cx", 0, 2), ("cy", 1, 2))},
        "transform_matrix": [[round(float(value), 12) for value in row] for row in pose],
    }
    if view.depths is not None and scene.unit == "metric":
        counts = np.rint(view.depths[0].numpy() / np.float32(MILLIMETRE))
        counts[counts >= SATURATED] = 0
        _write(archive, f"depth/{stem}.png", png_bytes(counts.astype(np.uint16)))
        entry["depth_file_path"] = f"depth/{stem}.png"
    if view.labels is not None:
        _write(archive, f"labels/{stem}.png", png_bytes(view.labels[0].numpy()))
        entry["label_file_path"] = f"labels/{stem}.png"
    if view.hidden is not None:
        _write(archive, f"masks/{stem}.png", png_bytes(np.where(view.hidden[0].numpy(), 0, 255).astype(np.uint8)))
        entry["mask_path"] = f"masks/{stem}.png"
    return entry


def _transforms(scene: Scene, listed: list[dict[str, Any]]) -> dict[str, Any]:
    """The content of `transforms.json`; values that all frames share are stored once."""
    alike = {key: listed[0][key] for key in ("w", "h", "fl_x", "fl_y", "cx", "cy")}
    alike = {key: value for key, value in alike.items() if all(entry[key] == value for entry in listed)}
    shared: dict[str, Any] = {"camera_model": "PINHOLE", **alike, "metric": scene.unit == "metric"}
    if scene.unit == "metric":
        shared["depth_unit_scale_factor"] = MILLIMETRE
    if scene.classes is not None:
        table = scene.classes.name if scene.classes in TABLES else OWN_TABLE
        shared |= {"label_set": table, "label_ignore": IGNORE}
    if scene.applied_transform is not None:
        shared["applied_transform"] = scene.applied_transform.tolist()
    if scene.applied_scale is not None:
        shared["applied_scale"] = scene.applied_scale
    frames = [{key: value for key, value in entry.items() if key not in alike} for entry in listed]
    return {**shared, "frames": frames}


def _record(scene: Scene, listed: list[dict[str, Any]], pixels: np.ndarray, settings: Preparation) -> dict[str, Any]:
    """The content of `prepared.json`."""
    named = {name: int(pixels[label]) for label, name in enumerate(scene.classes.names)} if scene.classes else {}
    labeller = labeller_of(scene)
    return {
        **settings.as_json(),
        "frames": len(listed),
        "depths": sum("depth_file_path" in entry for entry in listed),
        "labels": sum("label_file_path" in entry for entry in listed),
        "label_set": scene.classes.name if scene.classes else None,
        "pixels": {**named, "ignored": int(pixels[IGNORE])} if named else {},
        "notes": list(scene.notes),
        "source": fingerprint(scene),
        "terms": asdict(terms_of_photos(scene)),
        **({"labeller": asdict(labeller)} if labeller else {}),
    }


def _write(archive: zipfile.ZipFile, name: str, data: bytes) -> None:
    """Add an uncompressed file to an archive, without the current time."""
    info = zipfile.ZipInfo(name, _MIDNIGHT)
    info.compress_type, info.external_attr, info.create_system = zipfile.ZIP_STORED, 0o644 << 16, 3
    archive.writestr(info, data)


def _json(content: dict[str, Any]) -> bytes:
    """The bytes of a JSON file; lone surrogates (names that are not UTF-8) become JSON escapes."""
    return (json.dumps(content, indent=1, ensure_ascii=False, allow_nan=False) + "\n").encode(errors="backslashreplace")
