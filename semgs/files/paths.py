"""Paths that a user typed: told at once, before anything heavy is imported, where they lead nowhere."""

from __future__ import annotations

from pathlib import Path

from semgs.files.errors import InputError


def existing_folder(path: str | Path) -> Path:
    """The folder of a scene, whether the folder itself or a file inside it was named.

    Raises:
        InputError: nothing is there; the nearest folder that does exist is named.
    """
    path = Path(path).expanduser()
    if path.is_dir():
        return path
    if path.is_file():
        return path.parent
    nearest = next(parent for parent in path.absolute().parents if parent.is_dir())
    raise InputError(path, "a folder with a scene", "nothing there", advice=f"the path exists as far as {nearest}")
