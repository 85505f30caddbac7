"""Numbers in text files, however programs write them: any spacing, commas, comments and line ends."""

from __future__ import annotations

import re
from itertools import takewhile
from pathlib import Path

from semgs.files.contents import read_text
from semgs.files.errors import InputError

_NOT_A_NUMBER = re.compile(r"[+-]?(?:nan(?:\(.*\))?|1\.#[a-z]+0*(?:e[+-]\d+)?|inf(?:inity)?)", re.IGNORECASE | re.ASCII)
"""How C libraries print NaN and infinity. Microsoft's fills `1.#INF`, `1.#IND` and `1.#QNAN` up with zeros (`1.#INF00e+000`), or rounds them (`1.#J`)."""


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
