"""Opening scenes; the layout is detected automatically."""

from __future__ import annotations

from collections.abc import Callable, Collection
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

from semgs.data.confined import check_inside
from semgs.data.layouts import labelled_images, llff, metashape, transforms_json
from semgs.data.layouts.colmap import colmap_scene as colmap
from semgs.data.layouts.parts.readable_depths import without_unreadable_depth
from semgs.data.layouts.parts.usable_frames import PICTURES
from semgs.data.layouts.phones import polycam, record3d
from semgs.data.layouts.predictions import prediction_scene as predictions
from semgs.data.layouts.replica import sequence as replica
from semgs.data.layouts.rgbd import frame_files, tum
from semgs.data.layouts.rgbd import frame_folders as rgbd
from semgs.data.layouts.ros import bag_scene as ros
from semgs.data.layouts.scannet import scannet_scan as scannet
from semgs.data.layouts.scannetpp import scannetpp_scan as scannetpp
from semgs.data.other_cameras import (
    AS_LOG,
    MAP_FOLDERS,
    OPEN3D,
    arrays_inside,
    cameras_beside,
    stray_scanner_clip,
)
from semgs.data.paper_variants import check_applicable, check_readings
from semgs.data.scene import Scene
from semgs.data.scene_details import SceneDetails
from semgs.data.scene_lists import SceneList, scenes_by_name
from semgs.data.spread import spread
from semgs.files.bags import METADATA
from semgs.files.errors import InputError, readable
from semgs.files.paths import existing_folder, not_hidden, trained_splat, typed_path, without_dots
from semgs.files.text import listed


@dataclass(frozen=True)
class Layout:
    """A layout of scenes on disk.

    Attributes:
        recognises: whether a path has this layout.
        open: opens the scene; also takes `as_peers` if the layout has `readings`, and `details` if it has `details_used`.
        readings: the names from `semgs.data.paper_variants` that it supports.
        details_used: the fields of `semgs.data.scene_details.SceneDetails` that it uses.
    """

    recognises: Callable[[Path], bool]
    open: Callable[..., Scene]
    readings: tuple[str, ...] = ()
    details_used: tuple[str, ...] = ()

    def scene(self, path: Path, as_peers: Collection[str], details: SceneDetails) -> Scene:
        """The scene at a path with this layout.

        Raises:
            InputError: the scene cannot be opened, or the layout does not support a reading or a detail.
        """
        options = {"as_peers": as_peers} if self.readings else {}
        scene = self.open(path, **options, **({"details": details} if self.details_used else {}))
        if details.unit is not None:
            scene = replace(scene, unit=details.unit, unit_source="you say so")
        check_applicable(path, scene.layout, as_peers, self.readings)
        details.only(path, scene.layout, *self.details_used)
        return scene


LAYOUTS = (
    Layout(
        transforms_json.recognises,
        transforms_json.open_transforms,
        details_used=transforms_json.DETAILS,
    ),
    Layout(colmap.recognises, colmap.open_colmap, details_used=colmap.DETAILS),
    Layout(replica.recognises, replica.open_replica, replica.APPLICABLE, replica.DETAILS),
    Layout(tum.recognises, tum.open_tum, details_used=tum.DETAILS),
    Layout(rgbd.recognises, rgbd.open_rgbd, details_used=rgbd.DETAILS),  # not what only ScanNet has
    Layout(scannet.recognises, scannet.open_scannet, scannet.APPLICABLE),
    Layout(scannetpp.recognises, scannetpp.open_scannetpp, scannetpp.APPLICABLE),
    Layout(ros.recognises, ros.open_recording, details_used=ros.DETAILS),
    Layout(polycam.recognises, polycam.open_polycam, details_used=polycam.DETAILS),
    Layout(record3d.recognises, record3d.open_record3d, details_used=record3d.DETAILS),
    Layout(frame_files.recognises, frame_files.open_frame_files, details_used=frame_files.DETAILS),
    Layout(predictions.recognises, predictions.open_predictions),
    Layout(llff.recognises, llff.open_llff),
    Layout(metashape.recognises, metashape.open_metashape),
    Layout(labelled_images.recognises, labelled_images.open_labelled_images),
)
"""The known layouts. If a folder has several, the first one counts."""

SINGLE_FILES = (".zip", record3d.ENDING, *ros.ENDINGS)
"""Endings of files in a folder that may be scenes."""

LABELS_TRIED = 8
"""Label maps that are tried, if labels may be left out."""

DEEPEST, MOST_PLACES = 4, 200
"""So many levels of folders, and so many folders of each, are looked into for advice."""

VIDEOS = (".mp4", ".mov", ".m4v", ".avi", ".mkv", ".webm")
"""Endings of videos, for advice."""


SPLATS, OUTPUT = (".ply", ".spz", ".splat"), "scene.safetensors"
"""Endings of splats, and what shows that a folder is a result, for advice."""


def open_scene(
    path: str | Path,
    as_peers: Collection[str] = (),
    *,
    needs_labels: bool = True,
    needs_cameras: bool = True,
    **details: Any,
) -> Scene:
    """The scene at a path; its layout is detected automatically.

    Args:
        path: a folder of one of the known layouts, or the file that describes the scene.
        as_peers: names from `semgs.data.paper_variants.READINGS`: read files the way another paper's code does.
        needs_labels: whether labels that cannot be read are an error; if not, they are left out and a note says why.
        needs_cameras: whether labelled images without cameras are an error.
        details: what the files may not state, by the names of `semgs.data.scene_details.SceneDetails`: camera, world, body, intrinsics, depth_unit, images, unit.

    Raises:
        InputError: nothing is there, no layout is recognised (the error says what to do), the scene's files are damaged, the class
            table of its labels is unknown or damaged (if they are needed), or the layout does not support a reading or a detail.
        ValueError: a reading is unknown, or a detail is invalid.
        TypeError: there is no detail of a name.
    """
    if (images := details.get("images")) is not None:
        details["images"] = existing_folder(images)
    return open_with_details(path, as_peers, SceneDetails(**details), needs_labels, needs_cameras)


def open_predictions(path: str | Path, photos: str | Path) -> Scene:
    """The scene of a file of predicted cameras and depth, with its photos in a folder that need not be beside it.

    Args:
        path: the file, such as `predictions.npz`, or a folder with one.
        photos: the folder with the photos that it was made from.

    Raises:
        InputError: as `open_scene`, or the photos do not fit the file.
    """
    path, photos = typed_path(path), typed_path(photos)
    existing_folder(path)
    existing_folder(photos)
    with readable(path):
        if not predictions.recognises(path):
            raise InputError(path, predictions.LOOKED_FOR, "nothing like that")
        return predictions.open_predictions(path, photos)


def open_with_details(
    path: str | Path,
    as_peers: Collection[str],
    details: SceneDetails,
    needs_labels: bool = True,
    needs_cameras: bool = True,
) -> Scene:
    """As `open_scene`, with the details in one object."""
    check_readings(as_peers)
    path = typed_path(path)
    existing_folder(path)
    with readable(path):
        scene = _open_known(path, as_peers, details, needs_labels, needs_cameras)
        if scene is None:
            raise _unknown_layout(path, "a scene")
    return scene


def open_scenes(
    path: str | Path,
    as_peers: Collection[str] = (),
    details: SceneDetails | None = None,
    wanted: SceneList | None = None,
    needs_cameras: bool = True,
) -> tuple[Scene, ...]:
    """The scene at a path, or the scenes in that folder, or else those one level below, sorted by name.

    Folders without a known layout, and names that start with a dot, are skipped.

    Args:
        path: a scene as for `open_scene`, or a folder of scenes.
        as_peers: as for `open_scene`, for all scenes.
        details: details that apply to all scenes.
        wanted: the scenes to open; None for all.
        needs_cameras: as for `open_scene`.

    Raises:
        InputError: as `open_scene`; there is no scene, or one in `wanted` is missing; or two have the same name.
        ValueError: as `open_scene`.
    """
    check_readings(as_peers)
    details = details or SceneDetails()
    paths = scene_paths(path, wanted)
    with readable(path):
        known = (_open_known(place, as_peers, details, needs_cameras=needs_cameras) for place in paths)
        scenes = tuple(scene for scene in known if scene is not None)
    names: dict[str, Path] = {}
    for scene in scenes:
        if scene.name in names:
            raise InputError(scene.path, "scenes of different names", f"{scene.name}, as {names[scene.name]}")
        names[scene.name] = scene.path
    return scenes


def scene_paths(path: str | Path, wanted: SceneList | None = None) -> tuple[Path, ...]:
    """The paths of the scenes that `open_scenes` opens.

    Raises:
        InputError: there is no scene, or one in `wanted` is missing.
    """
    with readable(path):
        paths = _find_scenes(typed_path(path))
    if wanted is None:
        return paths
    chosen = set(wanted.choose(scenes_by_name(Path(path), paths), str(path)))
    return tuple(place for place in paths if place in chosen)


def is_scene(path: Path) -> bool:
    """Whether a path has a known layout, or a folder in it has one.

    Raises:
        InputError: it has the ending of an archive, but is none.
    """
    return _is_known(path) or (path.is_dir() and any(map(_is_known, _children(path))))


def _find_scenes(path: Path) -> tuple[Path, ...]:
    """The paths of all scenes."""
    existing_folder(path)
    if _is_known(path):
        return (path,)
    if path.is_file():
        raise _unknown_layout(path, "a scene")
    children = _children(path)
    scenes = [child for child in children if _is_known(child)]
    if not scenes:
        scenes = [below for child in children if child.is_dir() for below in _children(child) if _is_known(below)]
    if not scenes:
        raise _unknown_layout(path, "a scene or a folder of scenes")
    return tuple(scenes)


def _open_known(
    path: Path,
    as_peers: Collection[str],
    details: SceneDetails,
    needs_labels: bool = True,
    needs_cameras: bool = True,
) -> Scene | None:
    """The scene at a path, None if it has no known layout."""
    layout = next((known for known in LAYOUTS if known.recognises(path)), None)
    if layout is None:
        return None
    scene = layout.scene(without_dots(path), as_peers, details)
    check_inside(path, scene)
    scene = without_unreadable_depth(scene)
    if needs_cameras and not scene.posed:
        raise InputError(
            path, "images with cameras", f"{scene.layout}, which have none",
            advice="they are for semgs train --supervision pictures and semgs evaluate --single",
        )  # fmt: skip
    if scene.unread_labels is None:
        return scene if needs_labels else scene.with_readable_labels(spread(range(len(scene)), LABELS_TRIED))
    if needs_labels:
        raise scene.unread_labels
    return replace(scene, notes=(*scene.notes, f"The labels are left out: {scene.unread_labels}."))


def _children(path: Path) -> list[Path]:
    """Paths in a folder that may be scenes or contain some, sorted by name."""
    inside = sorted(child for child in path.iterdir() if not child.name.startswith("."))
    return [child for child in inside if child.is_dir() or child.suffix.lower() in SINGLE_FILES]


def _is_known(path: Path) -> bool:
    """Whether a folder has a known layout."""
    return any(layout.recognises(path) for layout in LAYOUTS)


UNPACKERS = {".zstd": "zstd", ".zst": "zstd", ".gz": "gzip", ".bz2": "bzip2", ".lz4": "lz4", ".xz": "xz"}
"""What unpacks files of these endings."""

_NO_VIDEOS = "a video has no poses; semgs poses CLIP --out OUT estimates them, and OUT is a scene"


def _unknown_layout(path: Path, expected: str) -> InputError:
    """The error for a path without a known layout, with what to do."""
    hint = _hint(path)
    page = f"it has neither photos nor a scene in a layout that is known here; {hint}"
    return InputError(path, expected, "no known layout", advice=hint, page=page)


def _hint(path: Path) -> str:
    """What to do about a path without a known layout: the likeliest remedy."""
    if (packed := _packed_recording(path)) is not None:
        program = UNPACKERS[packed.suffix.lower()]
        return f"{packed.name} is a recording that is compressed by {program}; unpack it first: {program} -d {packed}"
    if path.is_file():
        if path.suffix.lower() in SPLATS:
            return "a splat is a result and has no photos; semgs view, render and export open it"
        return _NO_VIDEOS if path.suffix.lower() in VIDEOS else "name the scene's folder"
    if (path / OUTPUT).is_file():
        return "this is a result of semgs reconstruct; semgs view, render, query and export open it"
    if (splat := trained_splat(path)) is not None:
        return f"this is what a 3DGS training wrote; semgs view, render, export and label-splat open its splat {splat}"
    if (clip := stray_scanner_clip(path)) is not None:
        return f"this is a capture of Stray Scanner, which is not read; semgs poses {clip} --out OUT estimates cameras from its clip"
    inside = _scene_below(path)
    if inside is not None:
        return _without_metadata(inside) or f"there is one in {inside}"
    files = list(path.iterdir())
    below = [
        place.name
        for place in sorted(files)
        if place.is_dir() and place.name.lower() not in MAP_FOLDERS and _kinds(place).intersection(PICTURES)
    ]
    pictures = _kinds(path).intersection(PICTURES) or below
    others = cameras_beside([path, *([path.parent] if _kinds(path).intersection(PICTURES) else [])]) if pictures else []
    if others:
        file, program = others[0]
        remedy = "write them as transforms.json (docs/conventions.md), or as a reader of your own in ten lines (docs/data.md)"
        remedy = AS_LOG if program == OPEN3D else remedy
        return f"{file} has cameras of {program}, which are not read: {remedy}; semgs poses estimates cameras anew"
    if _kinds(path).intersection(PICTURES) or len(below) == 1:
        return "images alone have no poses; semgs poses FOLDER --out OUT estimates them, and OUT is a scene"
    if below:
        return f"there are only images, in {listed(below)}; semgs poses estimates the poses of those in one folder"
    if _kinds(path).intersection(VIDEOS) or any(
        _kinds(place).intersection(VIDEOS) for place in files if place.is_dir()
    ):
        return _NO_VIDEOS
    if not files:
        return "the folder is empty"
    return arrays_inside(path) or "docs/data.md lists the known ones"


def _packed_recording(path: Path) -> Path | None:
    """The first recording at a path, or in a folder, that is compressed as a whole; None if there is none."""
    for file in [path] if path.is_file() else not_hidden(path.iterdir()):
        if file.suffix.lower() in UNPACKERS and Path(file.stem).suffix.lower() in ros.ENDINGS:
            return file
    return None


def _without_metadata(recording: Path) -> str | None:
    """What to do about the folder of a recording of ROS 2 that lacks `metadata.yaml`; None for other files and folders."""
    if recording.suffix.lower() not in (".db3", ".mcap") or not recording.is_file():
        return None
    folder = recording.parent
    reindex = f"without {METADATA}; ros2 bag reindex {folder} writes it"
    if sum(file.suffix.lower() == recording.suffix.lower() for file in not_hidden(folder.iterdir())) > 1:
        return f"{folder} has recordings {reindex} if they are parts of one bag"
    return f"{folder} is a ROS bag {reindex}, or open {recording} alone"


def _scene_below(path: Path) -> Path | None:
    """The nearest scene in the folders of a folder, None if there is none or too many folders would have to be looked into."""
    places = [path]
    for _ in range(DEEPEST):
        places = [child for place in places if place.is_dir() for child in _children(place)][:MOST_PLACES]
        if (found := next((one for one in places if _is_known(one)), None)) is not None:
            return found
    return None


def _kinds(folder: Path) -> set[str]:
    """The endings of the files in a folder, in lower case."""
    return {file.suffix.lower() for file in folder.iterdir()}
