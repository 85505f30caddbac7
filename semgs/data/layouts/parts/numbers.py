"""Numbers in text files, as programs of all kinds write them: any spacing, commas, comments, line ends of any system."""

from __future__ import annotations

import re
from pathlib import Path

from semgs.files.contents import read_text
from semgs.files.errors import InputError

_NOT_A_NUMBER = re.compile(r"[+-]?(?:nan(?:\(.*\))?|1\.#(?:qnan|snan|ind|inf)0*|inf(?:inity)?)", re.IGNORECASE)
"""What the C libraries of different systems print for numbers that are none, or are infinite."""


def lines(path: Path) -> list[tuple[int, str]]:
    """The lines of a text file that hold something, each with its number from 1; comments (#) are left out.

    Raises:
        InputError: it cannot be read, or is no text.
    """
    text = read_text(path)
    if "\0" in text:
        raise InputError(path, "text", "zero bytes")
    stripped = ((number, line.strip()) for number, line in enumerate(text.splitlines(), start=1))
    return [(number, line) for number, line in stripped if line and not line.startswith("#")]


def pairs(path: Path) -> dict[str, str]:
    """The lines `key = value` of a text file.

    Raises:
        InputError: it cannot be read, or is no text.
    """
    found = (line.partition("=") for _, line in lines(path) if "=" in line)
    return {key.strip(): value.strip() for key, _, value in found}


def rows(path: Path) -> list[tuple[int, list[float]]]:
    """The numbers in each line of a text file, with the line's number; what is no finite number comes as NaN or infinity.

    Raises:
        InputError: it cannot be read, or holds a word.
    """
    found = []
    for number, line in lines(path):
        words = re.split(r"[\s,;]+", line.strip(" \t,;[]"))
        try:
            found.append((number, [_value(word) for word in words]))
        except ValueError:
            raise InputError(path, "numbers", f"{line!r:.60}", f"line {number}") from None
    return found


def _value(word: str) -> float:
    """One number; not finite where it is printed so.

    Raises:
        ValueError: it is a word.
    """
    if _NOT_A_NUMBER.fullmatch(word):
        return float("nan")
    return float(word)
