"""Paths that a user typed: told at once, before anything heavy is imported, where they lead nowhere."""

from __future__ import annotations

import errno
from pathlib import Path
from typing import Literal

from semgs.files.errors import InputError, readable


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
        InputError: nothing is there (the nearest folder that does exist is named), or a folder on the way may not be entered.
    """
    path = typed_path(path)
    with readable(path):
        if path.is_dir():
            return path
        if path.is_file():
            return path.parent
        nearest = next(parent for parent in path.absolute().parents if parent.is_dir())
    raise InputError(path, "a folder with a scene", "nothing there", advice=f"the path exists as far as {nearest}")


def found_at(path: str | Path) -> Literal["a file", "a folder", "nothing there"]:
    """What is at a path, as errors name it; a name that is too long for any file has nothing there.

    Raises:
        InputError: a folder on the way may not be entered.
    """
    path = Path(path)
    try:
        if path.is_dir():
            return "a folder"
        return "a file" if path.exists() else "nothing there"
    except OSError as error:
        if error.errno == errno.ENAMETOOLONG:
            return "nothing there"
        raise InputError(path, "a path that can be followed", error.strerror or str(error)) from error


def check_utf8(path: str | Path, library: str) -> None:
    """Refuse a path whose name is no UTF-8, for a library that takes no other.

    Raises:
        InputError: it is none.
    """
    try:
        str(path).encode()
    except UnicodeEncodeError as error:
        raise InputError(path, f"a path in UTF-8, as {library} needs it", "other bytes", advice="rename it") from error
