"""Paths that a user typed: told at once, before anything heavy is imported, where they lead nowhere."""

from __future__ import annotations

from pathlib import Path

from semgs.files.errors import InputError


def typed_path(path: str | Path) -> Path:
    """A path as it was typed, with ~ (the user's own folder) and ~NAME (that of another) at its beginning replaced, as a shell does.

    Raises:
        InputError: nothing was typed, or nobody is called NAME.
    """
    if path == "":
        raise InputError('""', "a path", "an empty one", advice="name . for the folder you are in")
    try:
        return Path(path).expanduser()
    except RuntimeError as error:
        user = Path(path).parts[0]
        raise InputError(
            path,
            f"a user {user[1:]}" if user[1:] else "a home folder",
            "none",
            advice=f"a file of that name is ./{path}",
        ) from error


def existing_folder(path: str | Path) -> Path:
    """The folder of a scene, whether the folder itself or a file inside it was named.

    Raises:
        InputError: nothing is there; the nearest folder that does exist is named.
    """
    path = typed_path(path)
    if path.is_dir():
        return path
    if path.is_file():
        return path.parent
    nearest = next(parent for parent in path.absolute().parents if parent.is_dir())
    raise InputError(path, "a folder with a scene", "nothing there", advice=f"the path exists as far as {nearest}")
