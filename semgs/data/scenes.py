"""Opening scenes: which layout a folder has is found out here."""

from __future__ import annotations

from collections.abc import Callable, Collection, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

from semgs.data.asked import Asked
from semgs.data.layouts import transforms_json
from semgs.data.layouts.colmap import model as colmap
from semgs.data.layouts.replica import sequence as replica
from semgs.data.layouts.rgbd import folders as rgbd
from semgs.data.layouts.rgbd import frame_files, tum
from semgs.data.layouts.ros import recording as ros
from semgs.data.layouts.scannet import scan as scannet
from semgs.data.layouts.scannetpp import scan as scannetpp
from semgs.data.peers import check_applicable, check_readings
from semgs.data.scene import Scene
from semgs.data.scene_lists import SceneList, calls
from semgs.files.errors import InputError, readable
from semgs.files.paths import existing_folder, typed_path


@dataclass(frozen=True)
class Layout:
    """A layout of scenes on disk.

    Attributes:
        recognises: whether a path has it.
        open: the scene at such a path; a layout with `readings` also takes `as_peers`, one that `asks` takes `asked`.
        looked_for: what makes it recognised, in words.
        readings: those of `semgs.data.peers` that it knows.
        asks: the fields of `semgs.data.asked.Asked` that it takes.
    """

    recognises: Callable[[Path], bool]
    open: Callable[..., Scene]
    looked_for: str
    readings: tuple[str, ...] = ()
    asks: tuple[str, ...] = ()

    def scene(self, path: Path, as_peers: Collection[str], asked: Asked) -> Scene:
        """The scene at a path that has this layout.

        Raises:
            InputError: as `open`; or the layout has no such reading, or does not leave open what is told.
        """
        told = {"as_peers": as_peers} if self.readings else {}
        scene = self.open(path, **told, **({"asked": asked} if self.asks else {}))
        check_applicable(path, scene.layout, as_peers, self.readings)
        asked.only(path, scene.layout, *self.asks)
        return scene


LAYOUTS = (
    Layout(transforms_json.recognises, transforms_json.open_transforms, transforms_json.LOOKED_FOR),
    Layout(colmap.recognises, colmap.open_model, colmap.LOOKED_FOR),
    Layout(replica.recognises, replica.open_replica, replica.LOOKED_FOR, replica.APPLICABLE, replica.ASKS),
    Layout(tum.recognises, tum.open_tum, tum.LOOKED_FOR, asks=tum.ASKS),
    Layout(rgbd.recognises, rgbd.open_rgbd, rgbd.LOOKED_FOR, asks=rgbd.ASKS),  # not what only ScanNet has
    Layout(scannet.recognises, scannet.open_scan, scannet.LOOKED_FOR, scannet.APPLICABLE),
    Layout(scannetpp.recognises, scannetpp.open_scan, scannetpp.LOOKED_FOR, scannetpp.APPLICABLE),
    Layout(ros.recognises, ros.open_recording, ros.LOOKED_FOR, asks=ros.ASKS),
    Layout(frame_files.recognises, frame_files.open_frame_files, frame_files.LOOKED_FOR, asks=frame_files.ASKS),
)
"""The known layouts; of a folder that has several, the first counts."""

SINGLE_FILES = (".zip", *ros.ENDINGS)
"""Endings of files that may be a scene each, where a folder is looked through."""

LOOKED_FOR = ", or ".join(layout.looked_for for layout in LAYOUTS)


def open_scene(
    path: str | Path,
    as_peers: Collection[str] = (),
    *,
    camera: str | None = None,
    world: str | None = None,
    body: str | None = None,
    intrinsics: Sequence[float] | None = None,
    depth_unit: float | None = None,
    needs_labels: bool = True,
) -> Scene:
    """The scene at a path; its layout is recognised from what the folder holds.

    Args:
        path: a folder of one of the known layouts, or the file that describes the scene.
        as_peers: names of `semgs.data.peers.READINGS`: what to read as peers do, where ours differs.
        camera, world, body, intrinsics, depth_unit: as in `semgs.data.asked.Asked`, for layouts that leave them open.
        needs_labels: whether labels that are there but cannot be read are an error; if not, they are left out and a note says why.

    Raises:
        InputError: nothing is there, no layout is recognised (what was looked for is listed), the scene's own description is broken,
            the table of its labels is unknown or damaged (if they are needed), a reading is asked for that its layout does not have, or something is told that it does not leave open.
        ValueError: there is no reading of that name, or what is told cannot be.
    """
    return open_asked(path, as_peers, Asked(camera, world, body, intrinsics, depth_unit), needs_labels)


def open_asked(path: str | Path, as_peers: Collection[str], asked: Asked, needs_labels: bool = True) -> Scene:
    """As `open_scene`, with all that is told of the scene as one.

    Raises:
        InputError, ValueError: as `open_scene`.
    """
    check_readings(as_peers)
    path = typed_path(path)
    existing_folder(path)
    with readable(path):
        scene = _opened(path, as_peers, asked, needs_labels)
        if scene is None:
            raise InputError(path, f"a scene: {LOOKED_FOR}", "none of them", advice=_hint(path))
    return scene


def open_scenes(
    path: str | Path, as_peers: Collection[str] = (), asked: Asked | None = None, wanted: SceneList | None = None
) -> tuple[Scene, ...]:
    """The scene at a path, or else those right inside it, or else those one level below, in the order of their names.

    What has no known layout is passed over, as is what has a name that begins with a dot.

    Args:
        path: a scene as for `open_scene`, or a folder of such.
        as_peers: as for `open_scene`, for all of them.
        asked: what is told of all of them.
        wanted: those to open; None is all.

    Raises:
        InputError: as `open_scene`; there is no scene at all, or not one that is wanted; or two have the same name.
        ValueError: as `open_scene`.
    """
    check_readings(as_peers)
    told = asked or Asked()
    paths = scene_paths(path, wanted)
    with readable(path):
        scenes = tuple(scene for one in paths if (scene := _opened(one, as_peers, told)) is not None)
    names: dict[str, Path] = {}
    for scene in scenes:
        if scene.name in names:
            raise InputError(scene.path, "scenes of different names", f"{scene.name}, as {names[scene.name]}")
        names[scene.name] = scene.path
    return scenes


def scene_paths(path: str | Path, wanted: SceneList | None = None) -> tuple[Path, ...]:
    """Where the scenes of `open_scenes` are: the path itself, or else what is right inside it, or else one level below.

    Raises:
        InputError: nothing is there, no scene, or not one that is wanted.
    """
    with readable(path):
        found = _found(typed_path(path))
    if wanted is None:
        return found
    chosen = set(wanted.choose(calls(Path(path), found), str(path)))
    return tuple(one for one in found if one in chosen)


def _found(path: Path) -> tuple[Path, ...]:
    """As `scene_paths`, all of them."""
    existing_folder(path)
    if _recognised(path):
        return (path,)
    if path.is_file():
        raise InputError(path, f"a scene: {LOOKED_FOR}", "none of them", advice=_hint(path))
    children = _children(path)
    found = [child for child in children if _recognised(child)]
    if not found:
        found = [below for child in children if child.is_dir() for below in _children(child) if _recognised(below)]
    if not found:
        raise InputError(path, f"a scene or a folder of scenes: {LOOKED_FOR}", "none of them", advice=_hint(path))
    return tuple(found)


def _opened(path: Path, as_peers: Collection[str], asked: Asked, needs_labels: bool = True) -> Scene | None:
    """The scene at a path, None where it has no known layout.

    Raises:
        InputError: as `open_scene`.
    """
    layout = next((one for one in LAYOUTS if one.recognises(path)), None)
    if layout is None:
        return None
    scene = layout.scene(path, as_peers, asked)
    if scene.unread_labels is None:
        return scene
    if needs_labels:
        raise scene.unread_labels
    return replace(scene, notes=(*scene.notes, f"The labels are left out: {scene.unread_labels}."))


def _children(path: Path) -> list[Path]:
    """What may be a scene, or hold some, in a folder, by name."""
    inside = sorted(child for child in path.iterdir() if not child.name.startswith("."))
    return [child for child in inside if child.is_dir() or child.suffix.lower() in SINGLE_FILES]


def _recognised(path: Path) -> bool:
    """Whether a folder has a known layout."""
    return any(layout.recognises(path) for layout in LAYOUTS)


def _hint(path: Path) -> str | None:
    """What to do about a folder that holds no known layout."""
    if path.is_file():
        return "name the scene's folder"
    inside = next((child for child in _children(path) if _recognised(child)), None)
    if inside is not None:
        return f"there is one in {inside}"
    if any(child.suffix.lower() in (".jpg", ".jpeg", ".png") for child in path.iterdir()):
        return "pictures alone have no poses; run COLMAP on them first"
    return None
