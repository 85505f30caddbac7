"""The files of a capture, in a folder or in a zip archive, which is read in place."""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

from semgs.data.layouts.parts.usable_frames import sequence_name
from semgs.files.archives import Member, members
from semgs.files.stored import Stored


@dataclass(frozen=True)
class Capture:
    """A capture.

    Attributes:
        path: its folder or archive.
        archived: the members of the archive by their paths in the capture; None for a folder.
    """

    path: Path
    archived: Mapping[str, Member] | None = None

    @property
    def name(self) -> str:
        """The name of the scene."""
        return sequence_name(self.path) if self.archived is None else self.path.stem

    def file(self, name: str) -> Stored | None:
        """The file at a path in the capture, None if there is none."""
        if self.archived is not None:
            return self.archived.get(name)
        return self.path / name if (self.path / name).is_file() else None

    def numbered(self, folder: str, endings: Sequence[str]) -> dict[int, Stored]:
        """The files of a folder that are named by a number and one of the endings (lower case), sorted by number."""
        found = {}
        for name, file in self._inside(folder).items():
            stem, dot, ending = name.rpartition(".")
            if stem.isdecimal() and dot + ending.lower() in endings:
                found[int(stem)] = file
        return dict(sorted(found.items()))

    def _inside(self, folder: str) -> dict[str, Stored]:
        """The files of a folder by name."""
        if self.archived is None:
            return {one.name: one for one in (self.path / folder).iterdir()} if (self.path / folder).is_dir() else {}
        return {one.name: one for name, one in self.archived.items() if name.rpartition("/")[0] == folder}


def find_capture(path: Path, mark: str, ending: str = ".zip") -> Capture | None:
    """The capture at a path: the place that has a file or folder `mark`. None if there is none.

    An archive may contain it in folders of its own; the outermost place counts.

    Args:
        path: a folder or a file.
        mark: the name of the file or folder.
        ending: of archives, in lower case.

    Raises:
        InputError: it has the ending of an archive, but is not one, or is damaged.
    """
    if path.is_dir():
        return Capture(path) if (path / mark).exists() else None
    if path.suffix.lower() != ending or not path.is_file():
        return None
    held = members(path)
    places = {found[1] for name in held if (found := re.match(rf"((?:.*?/)??){re.escape(mark)}(?:/|$)", name))}
    places = {place for place in places if not place.startswith("__MACOSX/")}
    if not places:
        return None
    place = min(places, key=lambda one: (one.count("/"), one))
    return Capture(path, {name.removeprefix(place): one for name, one in held.items() if name.startswith(place)})
