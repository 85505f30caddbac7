"""Opening scenes: which layout a folder has is found out here."""

from __future__ import annotations

from pathlib import Path

from semgs.data.layouts import colmap, transforms_json
from semgs.data.scene import Scene
from semgs.files.errors import InputError
from semgs.files.paths import existing_folder


def open_scene(path: str | Path) -> Scene:
    """The scene at a path; its layout is recognised from what the folder holds.

    Args:
        path: a folder with a `transforms.json` or a COLMAP model, or a transforms file itself.

    Raises:
        InputError: nothing is there, no layout is recognised (what was looked for is listed), or the scene's own description is broken.
    """
    path = Path(path).expanduser()
    existing_folder(path)
    if transforms_json.recognises(path):
        return transforms_json.open_transforms(path)
    if colmap.recognises(path):
        return colmap.open_model(path)
    raise InputError(
        path,
        f"a scene: {transforms_json.LOOKED_FOR}, or {colmap.LOOKED_FOR}",
        "none of them",
        advice=_hint(path),
    )


def open_scenes(path: str | Path) -> tuple[Scene, ...]:
    """The scenes at the paths that `scene_paths` finds.

    Raises:
        InputError: as `open_scene`; there is no scene at all; or two have the same name.
    """
    scenes = tuple(open_scene(one) for one in scene_paths(path))
    names: dict[str, Path] = {}
    for scene in scenes:
        if scene.name in names:
            raise InputError(scene.path, "scenes of different names", f"{scene.name}, as {names[scene.name]}")
        names[scene.name] = scene.path
    return scenes


def scene_paths(path: str | Path) -> tuple[Path, ...]:
    """Where the scene at a path is, or else those in the folders right inside it, in the order of their names; none is opened.

    Folders of no known layout are passed over, as are those whose name begins with a dot.

    Raises:
        InputError: there is no scene at all.
    """
    path = Path(path).expanduser()
    existing_folder(path)
    if path.is_file() or _recognised(path):
        return (path,)
    inside = sorted(child for child in path.iterdir() if child.is_dir() and not child.name.startswith("."))
    scenes = tuple(child for child in inside if _recognised(child))
    if not scenes:
        raise InputError(
            path,
            f"a scene or a folder of scenes: {transforms_json.LOOKED_FOR}, or {colmap.LOOKED_FOR}",
            "none of them",
            advice=_hint(path),
        )
    return scenes


def _recognised(path: Path) -> bool:
    """Whether a folder has a known layout."""
    return transforms_json.recognises(path) or colmap.recognises(path)


def _hint(path: Path) -> str | None:
    """What to do about a folder that holds no known layout."""
    if path.is_file():
        return "name the scene's folder"
    inside = sorted(child for child in path.iterdir() if child.is_dir() and transforms_json.recognises(child))
    if inside:
        return f"there is one in {inside[0]}"
    if any(child.suffix.lower() in (".jpg", ".jpeg", ".png") for child in path.iterdir()):
        return "pictures alone have no poses; run COLMAP on them first"
    return None
