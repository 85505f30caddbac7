"""Stamps of files: whether something changed, without reading it."""

from __future__ import annotations

import os
from collections.abc import Iterator
from pathlib import Path


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
