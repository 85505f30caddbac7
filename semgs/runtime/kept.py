"""Networks that stay loaded in a process that works on many scenes, such as a worker of `semgs batch`; and stamps of files, which say whether something changed without reading it."""

from __future__ import annotations

import os
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any, TypeVar

Loaded = TypeVar("Loaded")

_kept: dict[Any, Any] | None = None


def keep_loaded() -> None:
    """From now on, `kept` loads each thing once in this process."""
    global _kept
    if _kept is None:
        _kept = {}


def kept(load: Callable[..., Loaded], *arguments: Any) -> Loaded:
    """What a function loads with these arguments; after `keep_loaded`, that of an earlier call with the same ones.

    Files and folders among the arguments are the same if their files have the same sizes and times.

    Args:
        load: the function. What it returns is shared and must not be changed.
        arguments: of the function; hashable.
    """
    if _kept is None:
        return load(*arguments)
    key = (load, arguments, tuple(stamps(Path(one)) for one in arguments if isinstance(one, str | Path)))
    if key not in _kept:
        _kept[key] = load(*arguments)
    return _kept[key]


def stamps(path: Path) -> tuple[tuple[str, int, int], ...]:
    """Name, size [bytes] and time of change [ns] of a file, or of every file in a folder, in the order of names; none if there is no such file."""
    files = sorted(one for one in _below(path) if one.is_file()) if path.is_dir() else [path] * path.is_file()
    found = [(one, one.stat()) for one in files]
    return tuple((str(one.relative_to(path.parent)), stat.st_size, stat.st_mtime_ns) for one, stat in found)


def _below(folder: Path) -> Iterator[Path]:
    """All files in a folder and those below it, also behind links, but each folder once: a link may lead back."""
    seen = set()
    for place, folders, names in os.walk(folder, followlinks=True):
        folders[:] = sorted(folders) if (real := os.path.realpath(place)) not in seen else []
        yield from (Path(place, name) for name in names if real not in seen)
        seen.add(real)
