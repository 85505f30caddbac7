"""Opening scenes: which layout a folder has is found out here."""

from __future__ import annotations

from collections.abc import Callable, Collection
from dataclasses import dataclass
from pathlib import Path

from semgs.data.layouts import colmap, scannet, transforms_json
from semgs.data.peers import check_applicable, check_readings
from semgs.data.scene import Scene
from semgs.files.errors import InputError
from semgs.files.paths import existing_folder


@dataclass(frozen=True)
class Layout:
    """A layout of scenes on disk.

    Attributes:
        recognises: whether a path has it.
        open: the scene at such a path; a layout with `readings` also takes those that are asked for.
        looked_for: what makes it recognised, in words.
        readings: those of `semgs.data.peers` that it knows.
    """

    recognises: Callable[[Path], bool]
    open: Callable[..., Scene]
    looked_for: str
    readings: tuple[str, ...] = ()


LAYOUTS = (
    Layout(transforms_json.recognises, transforms_json.open_transforms, transforms_json.LOOKED_FOR),
    Layout(scannet.recognises, scannet.open_scan, scannet.LOOKED_FOR, scannet.APPLICABLE),
    Layout(colmap.recognises, colmap.open_model, colmap.LOOKED_FOR),
)
"""The known layouts; of a folder that has several, the first counts."""

LOOKED_FOR = ", or ".join(layout.looked_for for layout in LAYOUTS)


def open_scene(path: str | Path, as_peers: Collection[str] = ()) -> Scene:
    """The scene at a path; its layout is recognised from what the folder holds.

    Args:
        path: a folder of one of the known layouts, or the file that describes the scene.
        as_peers: names of `semgs.data.peers.READINGS`: what to read as peers do, where ours differs.

    Raises:
        InputError: nothing is there, no layout is recognised (what was looked for is listed), the scene's own description is broken,
            or a reading is asked for that its layout does not have.
        ValueError: there is no reading of that name.
    """
    check_readings(as_peers)
    path = Path(path).expanduser()
    existing_folder(path)
    for layout in LAYOUTS:
        if layout.recognises(path):
            scene = layout.open(path, as_peers) if layout.readings else layout.open(path)
            check_applicable(path, scene.layout, as_peers, layout.readings)
            return scene
    raise InputError(path, f"a scene: {LOOKED_FOR}", "none of them", advice=_hint(path))


def open_scenes(path: str | Path, as_peers: Collection[str] = ()) -> tuple[Scene, ...]:
    """The scene at a path, or else those in the folders right inside it, in the order of their names.

    Folders of no known layout are passed over, as are those whose name begins with a dot.

    Args:
        path: a scene as for `open_scene`, or a folder of such.
        as_peers: as for `open_scene`, for all of them.

    Raises:
        InputError: as `open_scene`; there is no scene at all; or two have the same name.
        ValueError: as `open_scene`.
    """
    path = Path(path).expanduser()
    existing_folder(path)
    if path.is_file() or _recognised(path):
        return (open_scene(path, as_peers),)
    inside = sorted(child for child in path.iterdir() if child.is_dir() and not child.name.startswith("."))
    scenes = tuple(open_scene(child, as_peers) for child in inside if _recognised(child))
    if not scenes:
        raise InputError(path, f"a scene or a folder of scenes: {LOOKED_FOR}", "none of them", advice=_hint(path))
    names: dict[str, Path] = {}
    for scene in scenes:
        if scene.name in names:
            raise InputError(scene.path, "scenes of different names", f"{scene.name}, as {names[scene.name]}")
        names[scene.name] = scene.path
    return scenes


def _recognised(path: Path) -> bool:
    """Whether a folder has a known layout."""
    return any(layout.recognises(path) for layout in LAYOUTS)


def _hint(path: Path) -> str | None:
    """What to do about a folder that holds no known layout."""
    if path.is_file():
        return "name the scene's folder"
    inside = sorted(child for child in path.iterdir() if child.is_dir() and _recognised(child))
    if inside:
        return f"there is one in {inside[0]}"
    if any(child.suffix.lower() in (".jpg", ".jpeg", ".png") for child in path.iterdir()):
        return "pictures alone have no poses; run COLMAP on them first"
    return None
