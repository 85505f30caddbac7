"""Lists of scenes: published splits, splits by a rule, and your own; and the check that test scenes were not trained on.

A list is given by
- a name from the package (`semgs/data/lists`): "scannet-sray-test"
- a text file with one name per line, as data sets publish their splits: "scene0000_00", "office_0/Sequence_1"; lines with # are comments
- "ten:FILE" or "all-but-ten:FILE": ten held-out scenes of such a file, or all others (`held_out`)

Test scenes are compared with training scenes by room, not by scan: scene0211_00 and scene0211_03 show the same room.
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
from semgs.files.paths import typed_path, without_dots

Place = TypeVar("Place")

TEN, ALL_BUT_TEN = "ten:", "all-but-ten:"
"""Prefixes of a file, for ten of its scenes or for all others."""

HELD_OUT = 10
"""Number of ScanNet++ scenes that the paper tests on; it does not say which."""

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
        source: how the list was given, for errors.
        names: of the scenes, in order.
    """

    source: str
    names: tuple[str, ...]

    def choose(self, known: Mapping[str, Place], where: str) -> list[Place]:
        """The scenes of a folder that are in the list, in the list's order, each once.

        Args:
            known: the scenes of the folder by every name that a list may use, as from `scenes_by_name`.
            where: the folder, for errors.

        Raises:
            InputError: no scene has one of the names.
        """
        missing = [name for name in self.names if _plain(name) not in known]
        if missing:
            others = f" and {len(missing) - 1} more, which are missing" if len(missing) > 1 else ", which is missing"
            example = f", such as {next(iter(known))}" if known else ""
            raise InputError(
                self.source, f"names of scenes in {where}{example}", f"{missing[0]}{others}",
                f"{len(missing)} of {len(self.names)} names",
            )  # fmt: skip
        return list(dict.fromkeys(known[_plain(name)] for name in self.names))


def package_lists() -> tuple[str, ...]:
    """The names of the lists in the package."""
    return tuple(sorted(one.name.removesuffix(".txt") for one in _folder().iterdir() if one.name.endswith(".txt")))


def read_list(source: str | Path) -> SceneList:
    """A list by its name, a text file, or a rule and a text file.

    Raises:
        InputError: there is no such list or file, it cannot be read, is empty, or has too few scenes to hold out ten.
    """
    text = str(source)
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
    """Test scenes if no split is published: those whose names have the smallest SHA-256.

    The rule does not depend on the order of the list or on the scenes' content, and changes little with a new release of a data set.
    """
    return frozenset(sorted(set(names), key=lambda name: hashlib.sha256(os.fsencode(name)).hexdigest())[:count])


def room_of(name: str) -> str | None:
    """The room of a scene of ScanNet, ScanNet++, Replica or 7-Scenes, by its name ("scene0211_03" is in "scene0211").

    None for other names, because they are not unique: two data sets may both have a "scan1".
    """
    return next((match[1] for pattern in _ROOMS if (match := pattern.fullmatch(_plain(name)))), None)


def seen_before(trained: Iterable[str], tested: Iterable[str]) -> dict[str, str]:
    """Test scenes whose room was trained on, each with such a training scene."""
    rooms = {room: name for name in trained if (room := room_of(name)) is not None}
    return {name: rooms[room] for name in tested if (room := room_of(name)) in rooms and room is not None}


def check_unseen(path: str | Path, trained: Iterable[str], tested: Iterable[str], advice: str) -> None:
    """Refuse to test on rooms that were trained on.

    Args:
        path: the data or weights, for the error.
        trained, tested: names of scenes.
        advice: what the user can do.

    Raises:
        InputError: a test scene shows a room that was trained on; the error names all of them.
    """
    leaks = seen_before(trained, tested)
    if leaks:
        pairs = ", ".join(name if name == seen else f"{name} (as {seen})" for name, seen in sorted(leaks.items()))
        raise InputError(
            str(path), "scenes of rooms that were not trained on", f"{len(leaks)} that were: {pairs}", advice=advice
        )


def scenes_by_name(root: Path, paths: Sequence[Path]) -> dict[str, Path]:
    """The scenes below a folder, by every name that a list may use.

    These are the path below the folder (with _ or /), the name of the scene's own folder, and for 7-Scenes "sequence1". If two scenes share a
    name, it means the first.
    """
    root = typed_path(root)
    known: dict[str, Path] = {}
    for path in paths:
        place = Path(without_dots(path.absolute()).name) if path == root else path.relative_to(root)
        place = place if path.is_dir() else place.with_suffix("")
        numbered = re.fullmatch(r"seq-0*(\d+)", place.name)
        for name in (place.as_posix(), place.name, *([f"sequence{numbered[1]}"] if numbered else [])):
            known.setdefault(_plain(name), path)
    return known


def _plain(name: str) -> str:
    """One spelling of a name: office_0/Sequence_1 is prepared as office_0_Sequence_1."""
    return name.replace("\\", "/").strip("/").replace("/", "_")


def _names(path: str | Path, text: str) -> tuple[str, ...]:
    """The names in the text of a list."""
    lines = (line.strip().replace("\\", "/").rstrip("/") for line in text.splitlines())
    names = tuple(line for line in lines if line and not line.startswith("#"))
    if not names:
        raise InputError(path, "names of scenes, one per line", "an empty list")
    return names


def _folder() -> Path:
    """The folder of the lists in the package."""
    return Path(str(files("semgs.data"))) / "lists"
