"""Files whose names have the letters that a scene names, in another form of Unicode: macOS writes "ü" as "u" and two dots, most programs as one letter."""

from __future__ import annotations

from functools import lru_cache
from pathlib import Path

from semgs.data.confined import named_file
from semgs.files.stored import Stored
from semgs.files.text import composed

OTHER_FORM = "another form of letters such as é (macOS writes them as two characters)"
"""What such names have, for a note."""


def in_other_form(file: str | Stored, folder: Path, name: str) -> Path | None:
    """The file with a name but for the form of its letters, and of those of its folders. None if there is none, or several.

    Args:
        file: the file with the name, for errors.
        folder: the folder that the name is relative to.
        name: with slashes.

    Raises:
        InputError: the process is confined, and the name, or the file, is outside of its folder.
    """
    named_file(file, folder, name)  # asked of the whole name first
    if name.isascii():
        return None
    found = ""
    for part in name.split("/"):
        wanted = named_file(file, folder, found + part)
        if part and not wanted.exists():
            held = _names(wanted.parent).get(composed(part), [])
            if len(held) != 1:
                return None
            part = held[0]
        found += f"{part}/"
    place = named_file(file, folder, found.removesuffix("/"))
    return place if place.is_file() else None


def is_in_other_form(name: str, stored: Stored) -> bool:
    """Whether a file has a part of a name, with slashes, only in another form of its letters."""
    return any(not part.isascii() and part not in str(stored) for part in name.split("/"))


def _names(folder: Path) -> dict[str, list[str]]:
    """The names in a folder by their composed form; none if it cannot be listed."""
    try:
        return _listed(folder, folder.stat().st_mtime_ns)
    except OSError:
        return {}


@lru_cache(maxsize=8)
def _listed(folder: Path, _changed: int) -> dict[str, list[str]]:
    """As `_names`, for a folder that was changed at a time [ns]: a scene asks for thousands of names in a few folders."""
    names: dict[str, list[str]] = {}
    for one in folder.iterdir():
        names.setdefault(composed(one.name), []).append(one.name)
    return names
