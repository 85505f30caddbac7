"""Data sets that scenezoo reads, as scenes. https://github.com/eamonn-zh/scenezoo

scenezoo knows where the files of a data set are; `semgs.data.layouts.zoo.data_sets` has what it leaves to its caller. Images are not rotated
upright. Nothing is downloaded.
"""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np

from semgs.data.cameras.lens import Lens
from semgs.data.frames import Frame
from semgs.data.layouts.parts.mesh_maps import MeshLabels
from semgs.data.layouts.parts.pose_files import checked_poses
from semgs.data.layouts.scannet.scannet_labels import find_table, read_table
from semgs.data.layouts.zoo.data_sets import LAYOUT, DataSet, ZooCamera, choose_camera
from semgs.data.layouts.zoo.scenezoo_library import scenezoo_errors, scenezoo_library
from semgs.data.layouts.zoo.shots import ZooDepth, ZooFrame, ZooLabels
from semgs.data.layouts.zoo.zoo_mesh import SceneMesh, mesh_files
from semgs.data.scene import Scene
from semgs.data.scene_details import SceneDetails
from semgs.data.tables.classes import SCANNET20
from semgs.files.errors import InputError, input_error

DETAILS = ("scenezoo",)

CAMERAS = ("rgb_intrinsics", "world_to_camera")
LENSES = ("PINHOLE", "OPENCV")
"""The camera models of scenezoo that are read: without distortion, and with k1, k2, p1, p2, k3."""


def open_zoo(path: Path, details: SceneDetails) -> Scene:
    """A scene of a data set that scenezoo reads.

    Args:
        path: the folder of the data set.
        details: `scenezoo` says which data set it is, and which of its scenes.

    Raises:
        InputError: the data set is not known or not supported, or scenezoo cannot read the scene.
        ImportError: scenezoo is not installed.
    """
    name, scene, part = (*str(details.scenezoo).split(":"), "")[:3]
    data, source = choose_camera(path, name.lower(), part)
    named = [
        one for place in (path, path / "metadata") if data.names_file and (one := place / data.names_file).is_file()
    ]
    with scenezoo_errors(path):
        library = scenezoo_library()
        opened = library.get_dataset(data.name, path, offline=True, **({data.names_keyword: named[0]} if named else {}))
    keywords = {"room_id": part} if data.has_rooms else {}
    if source.name:
        keywords["source"] = source.name
    return zoo_scene(opened, path, scene, data, source, keywords, bool(named) or not data.names_file)


def zoo_scene(
    opened: Any,
    path: Path,
    scene: str,
    data: DataSet,
    source: ZooCamera,
    keywords: Mapping[str, str],
    names_known: bool,
) -> Scene:
    """The scene of an opened data set.

    Args:
        opened: scenezoo's data set.
        path: its folder.
        scene: scenezoo's name of the scene.
        data, source: the data set, and the camera.
        keywords: what else scenezoo needs to know: the camera, or the room.
        names_known: whether the names of the labels can be read.

    Raises:
        InputError: scenezoo cannot read it, or a camera is not supported.
    """
    items = (*CAMERAS, *(("depth_intrinsics",) if source.own_depth_camera else ()))
    with scenezoo_errors(path):
        batch = opened.get_frames(scene, items=items, rotate_to_up=False, **keywords)
    if batch.camera_model not in LENSES:
        raise InputError(path, f"a camera of {' or '.join(LENSES)}", f"{batch.camera_model}", scene)
    shots = [ZooFrame(opened, path, scene, int(index), keywords) for index in batch.indices]
    names = batch.frame_keys or [f"{shot.index:06d}" for shot in shots]
    if not shots:
        raise InputError(path, "at least two frames with a pose", "none", scene)
    first = shots[0].item("rgb").shape[:2]
    sizes = [first] * len(shots)
    if batch.image_sizes is not None:
        sizes = [(int(height), int(width)) for width, height in batch.image_sizes]
    notes: list[str] = []
    depth = source.depth and _readable(shots[0], "depth", "depth", notes)
    confidence = depth and source.confidence and _readable(shots[0], "confidence_maps", "confidence of depth", notes)
    depth_size = shots[0].item("depth").shape if depth and source.own_depth_camera else None
    mesh = _mesh(opened, path, scene, data, names_known, notes)
    has_labels = mesh is not None or data.label_images
    with np.errstate(all="ignore"):
        poses = [np.linalg.inv(np.asarray(matrix, np.float64)) for matrix in batch.world_to_camera]
    frames = []
    for index, (shot, pose) in enumerate(
        zip(shots, checked_poses(path, poses, [one.name for one in shots]), strict=True)
    ):
        lens = _lens(shot, sizes[index], batch.rgb_intrinsics[index], source, _distortion(batch, index))
        of_depth = _lens(shot, depth_size, batch.depth_intrinsics[index], source) if depth_size else None
        frames.append(
            Frame(
                name=names[index],
                picture=shot,
                lens=lens,
                world_from_camera=pose,
                depth=ZooDepth(shot, of_depth, confidence) if depth else None,
                labels=MeshLabels(mesh) if mesh else ZooLabels(shot) if data.label_images else None,
            )
        )
    return Scene(
        path=path,
        name="_".join((scene, *([keywords["room_id"]] if "room_id" in keywords else []))),
        layout=f"{LAYOUT} {data.name}",
        unit="metric",
        frames=tuple(frames),
        classes=SCANNET20 if has_labels else None,
        notes=tuple(notes),
    )


def _lens(
    shot: ZooFrame, size: tuple[int, ...], intrinsics: np.ndarray, source: ZooCamera, distortion: tuple[float, ...] = ()
) -> Lens:
    """A camera of a frame, its principal point counted from the corner of the first pixel."""
    height, width = size
    fx, fy, cx, cy = (float(intrinsics[place]) for place in ((0, 0), (1, 1), (0, 2), (1, 2)))
    cy = cy + source.half
    with input_error(shot, "a camera"):
        k1, k2, p1, p2, k3 = distortion or (0.0,) * 5
        centre = (cx + source.half, height - cy if source.from_below else cy)
        return Lens((height, width), (fx, fy), centre, (k1, k2, p1, p2, k3))


def _distortion(batch: Any, index: int) -> tuple[float, ...]:
    """The distortion of a frame, empty for a pinhole."""
    if batch.camera_model == "PINHOLE" or batch.distortion is None:
        return ()
    return tuple(float(one) for one in batch.distortion[index])


def _readable(shot: ZooFrame, item: str, what: str, notes: list[str]) -> bool:
    """Whether an item was downloaded with the data set, judged by one frame; a note if not."""
    try:
        shot.item(item)
    except InputError as error:
        notes.append(f"The {what} is left out: {error.found}")
        return False
    return True


def _mesh(opened: Any, path: Path, scene: str, data: DataSet, names_known: bool, notes: list[str]) -> SceneMesh | None:
    """The labelled mesh, None with a note if the scene has none."""
    if not data.mesh:
        return None
    if not names_known:
        notes.append(f"The labels are left out: {data.names_file} is not in the data set's folder.")
        return None
    found = find_table(path)
    mesh = SceneMesh(opened, path, scene, data, mesh_files(path, scene), read_table(found) if found else None)
    try:
        mesh.triangles()
    except (InputError, ImportError) as error:
        notes.append(f"The labels are left out: {error.found if isinstance(error, InputError) else error}")
        return None
    return mesh
