"""Paths that a user typed: expanded, and checked before heavy imports.

The cache folder is here too, for results that can be recomputed. It is outside the data sets, which may be read-only or shared.
"""

from __future__ import annotations

import errno
import os
from collections.abc import Iterable
from os import PathLike
from pathlib import Path
from typing import Literal

from semgs.files.errors import InputError, readable

TRAINED = "point_cloud/iteration_*/point_cloud.ply"
"""Where 3DGS, and what was made of it, put the splats of a training."""

VARIABLE = "SEMGS_CACHE"


def typed_path(path: str | Path) -> Path:
    """A path with a leading ~ or ~NAME expanded, as a shell does.

    Raises:
        InputError: it is empty, or there is no user NAME.
        TypeError: it is no path.
    """
    if not isinstance(path, str | PathLike):
        raise TypeError(f"a path is {type(path).__name__}; expected text or pathlib.Path")
    if path == "":
        raise InputError('""', "a path", "an empty one", advice="use . for the current folder")
    try:
        return Path(path).expanduser()
    except RuntimeError as error:
        user = Path(path).parts[0]
        raise InputError(
            path,
            f"a user {user[1:]}" if user[1:] else "a home folder",
            "none",
            advice=f"for a file with that name, use ./{path}",
        ) from error


def files_among(*words: str | None) -> list[str]:
    """Those words that are files, among names of other things (of included weights, of lists)."""
    return [one for one in words if one and typed_path(one).is_file()]


def without_dots(path: Path) -> Path:
    """A path without `..`, so that its parts are names; the rest is as typed."""
    if ".." not in path.parts:
        return path
    after = path.parts[::-1].index("..")
    rest = path.parts[len(path.parts) - after :]
    return Path(*path.parts[: len(path.parts) - after]).resolve().joinpath(*rest)


def existing_folder(path: str | Path, expected: str = "a folder with a scene") -> Path:
    """The folder of a scene, given the folder or a file in it.

    Args:
        path: the folder or file.
        expected: what it is, for the error.

    Raises:
        InputError: it does not exist (the error names the nearest folder that does), or a folder on the way cannot be entered.
    """
    path = typed_path(path)
    with readable(path):
        if path.is_dir():
            return path
        if path.is_file():
            return path.parent
        nearest = next(parent for parent in path.absolute().parents if parent.is_dir())
    raise InputError(path, expected, "nothing there", advice=f"the path exists up to {nearest}")


def not_hidden(paths: Iterable[Path]) -> list[Path]:
    """Paths sorted, without those whose name begins with a dot, as of the files ._NAME that macOS writes beside each file on other systems' disks."""
    return sorted(path for path in paths if not path.name.startswith("."))


def found_at(path: str | Path) -> Literal["a file", "a folder", "nothing there"]:
    """What is at a path, for errors; nothing if the name is too long for any file.

    Raises:
        InputError: a folder on the way cannot be entered.
    """
    path = Path(path)
    try:
        if path.is_dir():
            return "a folder"
        return "a file" if path.exists() else "nothing there"
    except OSError as error:
        if error.errno == errno.ENAMETOOLONG:
            return "nothing there"
        raise InputError(path, "a path that can be read", error.strerror or str(error)) from error


def check_utf8(path: str | Path, library: str) -> None:
    """Refuse a path that is not UTF-8, for a library that needs it.

    Raises:
        InputError: it is not UTF-8.
    """
    try:
        str(path).encode()
    except UnicodeEncodeError as error:
        raise InputError(path, f"a path in UTF-8, as {library} needs it", "other bytes", advice="rename it") from error


def trained_splat(folder: Path) -> Path | None:
    """The splat of the last iteration in the output folder of a training of 3DGS, None if it is no such folder."""
    steps = {path: path.parent.name.removeprefix("iteration_") for path in folder.glob(TRAINED)}
    return max(
        (path for path, step in steps.items() if step.isdigit()), key=lambda path: int(steps[path]), default=None
    )


def cache_folder() -> Path:
    """The folder named by SEMGS_CACHE, else `semgs` in XDG_CACHE_HOME or `~/.cache`. It may not exist, and may be deleted at any time."""
    named = os.environ.get(VARIABLE)
    if named:
        return Path(named).expanduser()
    return Path(os.environ.get("XDG_CACHE_HOME") or Path.home() / ".cache") / "semgs"
