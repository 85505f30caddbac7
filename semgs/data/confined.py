"""Files that a scene names, such as `file_path` in a `transforms.json`, and where they may be.

On the command line they may be anywhere, as real scenes list `../images/0.png`. A process that reads the scene of somebody else, such as the worker of
`semgs app`, confines itself to the folder of that scene: names that lead out of it are refused before the file system is touched, so that an error does
not tell which files exist. The folder is in the environment, so that threads and child processes have it too.
"""

from __future__ import annotations

import os
from collections.abc import Iterator, Mapping
from dataclasses import fields, is_dataclass
from functools import lru_cache
from pathlib import Path

from semgs.files.errors import InputError
from semgs.files.stored import Stored

VARIABLE = "SEMGS_CONFINED_TO"
"""The environment variable with the folder."""

INCLUDED = Path(__file__).resolve().with_name("demo")
"""The scene that comes with SemGS."""

LONGEST_NAME, LONGEST_PATH = 255, 4000
"""Bytes of one part of a path, and of all of it; file systems refuse longer ones."""

EXPECTED = "names of files inside the scene's folder"


def confine_to(folder: Path) -> None:
    """Let this process, and those that it starts, open only scenes whose files are all in a folder."""
    os.environ[VARIABLE] = str(folder.resolve())


def named_file(file: str | Stored, folder: Path, name: str) -> Path:
    """The path of a file that another file names. Every reader joins names from data with this function.

    Args:
        file: the file with the name, for the error.
        folder: the folder that the name is relative to.
        name: as in the file.

    Raises:
        InputError: the process is confined, and the name leads out of its folder, whether or not there is a file.
    """
    roots = _roots()
    if roots and not any(_leads_inside(root, folder, name) for root in roots):
        raise InputError(file, EXPECTED, f"{name!r:.60}")
    return folder / name


def may_read(path: Path) -> bool:
    """Whether a place may be searched: any, but those outside the folder of a confined process. For places that no file names, such as the folder above."""
    roots = _roots()
    return not roots or _is_inside(roots, path)


def check_inside(path: str | Path, content: object) -> None:
    """Check all paths in some data, as a second line of defence.

    Args:
        path: what the data are from, for the error.
        content: a dataclass, which may contain further ones.

    Raises:
        InputError: the process is confined, and a path in the data leads out of its folder.
    """
    roots = _roots()
    if roots and not all(_is_inside(roots, one) for one in set(_paths_in(content, set()))):
        raise InputError(path, EXPECTED, "one that leads out of it")


def _roots() -> tuple[Path, ...]:
    """The folder that this process is confined to, and the included scene, which holds nothing that is not public; empty if it is not confined."""
    folder = os.environ.get(VARIABLE)
    return (_resolved(Path(folder).absolute()), INCLUDED) if folder else ()


def _leads_inside(root: Path, folder: Path, name: str) -> bool:
    """Whether a name leads to a place inside a folder, without leaving it on the way. Outside, nothing is touched."""
    base, plain = _resolved(folder.absolute()), name.replace("\\", "/")
    if "\0" in name or "://" in name or plain.startswith("~") or Path(plain).is_absolute() or Path(name).is_absolute():
        return False
    if not base.is_relative_to(root) or len(name) > LONGEST_PATH:
        return False
    depth = len(base.relative_to(root).parts)
    for part in plain.split("/"):
        depth += -1 if part == ".." else part not in ("", ".")
        if depth < 0 or len(part.encode(errors="surrogatepass")) > LONGEST_NAME:
            return False
    return all(_is_inside((root,), folder / one) for one in {name, plain})


@lru_cache(maxsize=256)
def _resolved(folder: Path) -> Path:
    """A folder with its links resolved. Kept, as a model of COLMAP has thousands of names in a few folders; the files themselves are resolved each time."""
    return folder.resolve()


def _is_inside(roots: tuple[Path, ...], path: Path) -> bool:
    """Whether a path, with its links resolved, lies in one of some folders."""
    try:
        place = path.resolve()
    except (OSError, RuntimeError, ValueError):  # such as a loop of links
        return False
    return any(place.is_relative_to(root) for root in roots)


def _paths_in(content: object, seen: set[int]) -> Iterator[Path]:
    """All paths in dataclasses and collections, each object once."""
    if isinstance(content, Path):
        yield content
    elif id(content) not in seen:
        seen.add(id(content))
        if is_dataclass(content):
            inside = [getattr(content, field.name) for field in fields(content)]
        elif isinstance(content, Mapping):
            inside = [*content.keys(), *content.values()]
        else:
            inside = list(content) if isinstance(content, tuple | list | set | frozenset) else []
        for one in inside:
            yield from _paths_in(one, seen)
