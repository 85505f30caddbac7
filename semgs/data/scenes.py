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
