"""Numbers in text files, however programs write them: any spacing, commas, comments and line ends.

Comments may name the columns: where the pose is in each line, and the unit of its time.

# timestamp tx ty tz qx qy qz qw                                                  TUM RGB-D
#timestamp [ns], p_RS_R_x [m], p_RS_R_y [m], p_RS_R_z [m], q_RS_w [], q_RS_x []   EuRoC, TUM VI: w comes first
#timestamp x y z qx qy qz qw id                                                   RTAB-Map
"""

from __future__ import annotations

import re
from dataclasses import dataclass
from itertools import takewhile
from pathlib import Path

from semgs.files.contents import read_text
from semgs.files.errors import InputError

_NOT_A_NUMBER = re.compile(r"[+-]?(?:nan(?:\(.*\))?|1\.#[a-z]+0*(?:e[+-]\d+)?|inf(?:inity)?)", re.IGNORECASE | re.ASCII)
"""How C libraries print NaN and infinity. Microsoft's fills `1.#INF`, `1.#IND` and `1.#QNAN` up with zeros (`1.#INF00e+000`), or rounds them (`1.#J`)."""

POSE = ("x", "y", "z", "qx", "qy", "qz", "qw")
NAMES = "columns named time, x, y, z, qx, qy, qz, qw, each once"

MATRICES = (4, 12, 16)
"""Numbers per line that are a matrix, or a row of one, if their columns are not those of a pose."""

_POSITION = re.compile(r"(?:(?:.*\.)?(?:t|p|pos|position|trans|translation)(?:_\w+)??[_.]?)?([xyz])")
_QUATERNION = re.compile(r"(?:.*\.)?(?:q|quat|quaternion|ori|orientation|rot|rotation)(?:_\w+)??[_.]?([xyzw])")
_TIME = re.compile(r"t|ts|.*(?:time|stamp).*")
_UNIT = re.compile(r"(?:time|stamp)[^\W_]*(?:\s*[\[(]\s*|_)([mun]s)(?![^\W_])", re.IGNORECASE)
_PER_SECOND = {"ms": 1e3, "us": 1e6, "ns": 1e9}


def read_lines(path: Path) -> list[tuple[int, str]]:
    """The lines of a text file, each with its number from 1, without empty lines and comments (#).

    Raises:
        InputError: it cannot be read, or is not text.
    """
    return [(number, line) for number, line in _lines(path) if not line.startswith("#")]


def read_comments(path: Path) -> list[tuple[int, str]]:
    """The comments (#) before the first other line of a text file, each with the number of its line, without the sign.

    Raises:
        InputError: it cannot be read, or is not text.
    """
    comments = takewhile(lambda numbered: numbered[1].startswith("#"), _lines(path))
    return [(number, line.lstrip("# \t")) for number, line in comments]


def _lines(path: Path) -> list[tuple[int, str]]:
    """The lines of a text file that are not empty, each with its number."""
    text = read_text(path)
    if "\0" in text:
        raise InputError(path, "text", "zero bytes")
    stripped = ((number, line.strip()) for number, line in enumerate(text.splitlines(), start=1))
    return [(number, line) for number, line in stripped if line]


def read_pairs(path: Path) -> dict[str, str]:
    """The lines `key = value` of a text file.

    Raises:
        InputError: it cannot be read, or is not text.
    """
    found = (line.partition("=") for _, line in read_lines(path) if "=" in line)
    return {key.strip(): value.strip() for key, _, value in found}


def read_rows(path: Path) -> list[tuple[int, list[float]]]:
    """The numbers in each line of a text file, with the line's number; NaN for numbers that are not finite.

    Raises:
        InputError: it cannot be read, or contains a word.
    """
    found = []
    for number, line in read_lines(path):
        words = re.split(r"[\s,;]+", line.strip(" \t,;[]"))
        try:
            found.append((number, [_value(word) for word in words]))
        except ValueError:
            raise InputError(path, "numbers", f"{line!r:.60}", f"line {number}") from None
    return found


def _value(word: str) -> float:
    """One number; NaN if it is not finite."""
    if _NOT_A_NUMBER.fullmatch(word):
        return float("nan")
    return float(word)


@dataclass(frozen=True)
class Columns:
    """Where the parts of a pose are in a line of numbers.

    Attributes:
        pose: positions of tx, ty, tz, qx, qy, qz, qw.
        time: position of the time; None if there is none.
        id: position of the frame's id; None if there is none.
    """

    pose: tuple[int, ...]
    time: int | None = None
    id: int | None = None


UNNAMED = {7: Columns(tuple(range(7))), 8: Columns(tuple(range(1, 8)), time=0)}
"""Columns by the numbers per line, if no comment names them: TUM's, with and without the time."""


def pose_columns(path: Path, count: int) -> Columns | None:
    """Where the pose is in lines of so many numbers; None if they are no position and quaternion.

    Raises:
        InputError: a comment names columns, but not each part of a pose once, or not as many as there are numbers.
    """
    for number, line in reversed(read_comments(path)):
        names = [_meaning(word) for word in re.split(r"[\s,;:|]+", re.sub(r"[\[(].*?[\])]", " ", line)) if word]
        parts = [name for name in names if name in POSE]
        complete = sorted(parts) == sorted(POSE)
        rotation = any(name in parts for name in POSE[3:]) or len(names) == count
        if len(parts) < 3 or not rotation or (count in MATRICES and not complete):
            continue
        if len(names) != count:  # words before and after the names
            known = [index for index, name in enumerate(names) if name]
            names = names[known[0] : known[-1] + 1]
        if complete and len(names) == count:
            time, frame = (names.index(name) if name in names else None for name in ("time", "id"))
            return Columns(tuple(map(names.index, POSE)), time, frame)
        if tuple(parts) != POSE or count not in UNNAMED:
            found = f"{line!r:.160} above lines of {count} numbers"
            advice = "correct the names, or remove the comment if lines are time tx ty tz qx qy qz qw"
            raise InputError(path, NAMES, found, f"line {number}", advice)
    return UNNAMED.get(count)


def times_per_second(path: Path) -> float | None:
    """How many units of a file's times are a second, if a comment says ms, us or ns (`timestamp [ns]`); else None."""
    units = (_UNIT.search(line) for _, line in read_comments(path))
    return next((_PER_SECOND[unit[1].lower()] for unit in units if unit), None)


def notes_on_names(path: Path) -> tuple[str, ...]:
    """A note if columns are named as EuRoC and TUM VI name the poses of their IMU."""
    if not any("p_rs_" in line.lower() for _, line in read_comments(path)):
        return ()
    return (
        f"Poses in {path.name} are taken for the camera's. Its columns are named as those of EuRoC and TUM VI, whose poses are the IMU's: if so, multiply them by T_BS of "
        "the camera.",
    )


def _meaning(word: str) -> str:
    """What a name of a column means: "time", "id", a part of `POSE`, or "" for anything else."""
    word = word.lower()
    if word == "id" or _TIME.fullmatch(word):
        return "id" if word == "id" else "time"
    if found := _QUATERNION.fullmatch(word):
        return f"q{found[1]}"
    return found[1] if (found := _POSITION.fullmatch(word)) else ""
