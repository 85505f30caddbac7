"""Lists of scenes: the splits that others tested on, those that follow from a rule, and one's own; and what a training may not have seen.

A list is asked for by
- its name, of those inside the package (`semgs/data/lists`): "scannet-sray-test"
- a text file with a name a line, as the splits of data sets come: "scene0000_00", "office_0/Sequence_1"; lines that begin with # are notes
- "ten:FILE" or "all-but-ten:FILE": ten scenes of such a file that are held out, and the others (`held_out`)

Whether a training has seen a scene is a question of rooms, not of scans: scene0211_00 and scene0211_03 show the same one.
"""

from __future__ import annotations

import hashlib
import os
import re
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from importlib.resources import files
from pathlib import Path
from typing import TypeVar

from semgs.files.contents import read_text
from semgs.files.errors import InputError
from semgs.files.paths import typed_path

Place = TypeVar("Place")

TEN, ALL_BUT_TEN = "ten:", "all-but-ten:"
"""What stands before a file of which ten scenes are wanted, or all others."""

HELD_OUT = 10
"""Scenes of ScanNet++ that the paper tests on; which, it does not say."""

_ROOMS = tuple(
    re.compile(pattern)
    for pattern in (
        r"(scene\d{4})_\d{2}",  # ScanNet: a room, then the number of its scan
        r"([0-9a-f]{10})",  # ScanNet++
        r"((?:office|room)_\d)_Sequence_\d",  # Replica
        r"(chess|fire|heads|office|pumpkin|redkitchen|stairs)_seq-\d+",  # 7-Scenes
    )
)


@dataclass(frozen=True)
class SceneList:
    """Names of scenes.

    Attributes:
        asked: how it was asked for, to name it in errors.
        names: of the scenes, in order.
    """

    asked: str
    names: tuple[str, ...]

    def choose(self, known: Mapping[str, Place], where: str) -> list[Place]:
        """Those of the scenes of a folder that are in the list, in its order, each once.

        Args:
            known: the scenes by all that a list may call them, as `calls` has it.
            where: the folder, to be told.

        Raises:
            InputError: a name is none of theirs.
        """
        missing = [name for name in self.names if _plain(name) not in known]
        if missing:
            others = f" and {len(missing) - 1} more that are not there" if len(missing) > 1 else ", which is not there"
            example = f", such as {next(iter(known))}" if known else ""
            raise InputError(
                self.asked, f"names of scenes in {where}{example}", f"{missing[0]}{others}",
                f"{len(missing)} of {len(self.names)} names",
            )  # fmt: skip
        return list(dict.fromkeys(known[_plain(name)] for name in self.names))


def package_lists() -> tuple[str, ...]:
    """The names of the lists inside the package."""
    return tuple(sorted(one.name.removesuffix(".txt") for one in _folder().iterdir() if one.name.endswith(".txt")))


def read_list(asked: str | Path) -> SceneList:
    """A list by its name, a text file, or a rule and a text file.

    Raises:
        InputError: there is no such list or file, it cannot be read, it is empty, or has no more than the ten to hold out.
    """
    text = str(asked)
    if text in package_lists():
        return SceneList(text, _names(text, (_folder() / f"{text}.txt").read_text(encoding="utf-8")))
    rule = next((one for one in (TEN, ALL_BUT_TEN) if text.startswith(one)), "")
    path = typed_path(text.removeprefix(rule))
    names = _names(path, read_text(path, f"a text file of scenes, or one of {', '.join(package_lists())}"))
    if not rule:
        return SceneList(text, names)
    if len(set(names)) <= HELD_OUT:
        raise InputError(path, f"more than {HELD_OUT} scenes, to hold out {HELD_OUT} of them", f"{len(set(names))}")
    ten = held_out(names)
    return SceneList(text, tuple(name for name in names if (name in ten) == (rule == TEN)))


def held_out(names: Iterable[str], count: int = HELD_OUT) -> frozenset[str]:
    """Scenes to test on where nobody says which: those whose names have the smallest SHA-256.

    The rule knows neither the order of a list nor what the scenes show, and another release of a data set changes little of it.
    """
    return frozenset(sorted(set(names), key=lambda name: hashlib.sha256(os.fsencode(name)).hexdigest())[:count])


def room_of(name: str) -> str | None:
    """The room that a scene of ScanNet, ScanNet++, Replica or 7-Scenes shows, by its name ("scene0211_03" is "scene0211").

    None for other names, which say nothing outside their folder: two data sets may both have a "scan1".
    """
    return next((match[1] for pattern in _ROOMS if (match := pattern.fullmatch(_plain(name)))), None)


def seen_before(trained: Iterable[str], tested: Iterable[str]) -> dict[str, str]:
    """Scenes that are tested on, each with one of the same room that was trained on."""
    rooms = {room: name for name in trained if (room := room_of(name)) is not None}
    return {name: rooms[room] for name in tested if (room := room_of(name)) in rooms and room is not None}


def check_unseen(path: str | Path, trained: Iterable[str], tested: Iterable[str], advice: str) -> None:
    """Refuse to test on rooms that were trained on.

    Args:
        path: what is tested on, or with, to be named.
        trained, tested: names of scenes.
        advice: what to do about it.

    Raises:
        InputError: a scene of both shows the same room; all are named.
    """
    leaks = seen_before(trained, tested)
    if leaks:
        pairs = ", ".join(name if name == seen else f"{name} (as {seen})" for name, seen in sorted(leaks.items()))
        raise InputError(
            str(path), "scenes of rooms that were not trained on", f"{len(leaks)} that were: {pairs}", advice=advice
        )


def calls(root: Path, paths: Sequence[Path]) -> dict[str, Path]:
    """The scenes below a folder by all that a list may call them.

    That is the place below the folder (with _ or / between), the folder's own name, and for 7-Scenes "sequence1". What two are called means
    the first.
    """
    root = typed_path(root)
    known: dict[str, Path] = {}
    for path in paths:
        place = Path(path.absolute().name) if path == root else path.relative_to(root)
        place = place if path.is_dir() else place.with_suffix("")
        numbered = re.fullmatch(r"seq-0*(\d+)", place.name)
        for name in (place.as_posix(), place.name, *([f"sequence{numbered[1]}"] if numbered else [])):
            known.setdefault(_plain(name), path)
    return known


def _plain(name: str) -> str:
    """A name as all its spellings have it: office_0/Sequence_1 is prepared as office_0_Sequence_1."""
    return name.replace("\\", "/").strip("/").replace("/", "_")


def _names(path: str | Path, text: str) -> tuple[str, ...]:
    """The names in the text of a list.

    Raises:
        InputError: there are none.
    """
    lines = (line.strip().replace("\\", "/").rstrip("/") for line in text.splitlines())
    names = tuple(line for line in lines if line and not line.startswith("#"))
    if not names:
        raise InputError(path, "names of scenes, one a line", "none: the list is empty")
    return names


def _folder() -> Path:
    """Where the lists inside the package are."""
    return Path(str(files("semgs.data"))) / "lists"
