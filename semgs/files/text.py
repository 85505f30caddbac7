"""Names of files, scenes and classes, made safe to print and sorted; and numbers in words, with two digits after the point, none for percentages."""

from __future__ import annotations

import math
import re
import unicodedata
from collections.abc import Iterable, Sequence
from difflib import get_close_matches


def printable(text: str) -> str:
    """The text with unprintable characters escaped; line ends stay.

    These are control characters (colours, cursor movements, titles), invisible characters that reorder text, and lone surrogates, which
    Python uses for file names that are not UTF-8.
    """
    if text.isprintable():
        return text
    return "".join(one if one.isprintable() or one == "\n" else _escaped(one) for one in text)


def shortened(text: str, most: int = 500) -> str:
    """The text, or its beginning and end, if it is longer than so many characters."""
    half = (most - 5) // 2
    return text if len(text) <= most else f"{text[:half]} ... {text[-half:]}"


def composed(name: str) -> str:
    """A name whose letters have their accents in one character, as far as Unicode has it (NFC): equal for all forms of a name."""
    return unicodedata.normalize("NFC", name)


def listed(names: Sequence[str], most: int = 5) -> str:
    """The first names on one line, and how many more there are."""
    rest = len(names) - most
    return ", ".join(names[:most]) + (f" and {rest} more" if rest > 0 else "")


def counted(count: int, one: str, more: str = "") -> str:
    """A number of things: "1 scene", "1,200 scenes"; "0 scenes".

    Args:
        count: how many.
        one: the word, or the words, for one.
        more: the same for several; by default with an s at the end.
    """
    return f"{count:,} {one if count == 1 else more or f'{one}s'}"


def aligned(rows: Sequence[tuple[str, str]]) -> list[str]:
    """Lines of name and text, with the texts below each other."""
    width = max(len(name) for name, _ in rows)
    return [f"{name:<{width}}  {text}" for name, text in rows]


def did_you_mean(typed: str, known: Iterable[str]) -> str:
    """ "; did you mean ...?" with the most similar known word; "" if no word is similar."""
    similar = get_close_matches(typed, list(known), 1)
    return f"; did you mean {similar[0]}?" if similar else ""


def natural_order(name: str) -> tuple[list[tuple[int, str]], str]:
    """A key to sort names with numbers in them: text and numbers alternate, and numbers count by value, so 2 comes before 10."""
    parts = re.split(r"([0-9]+)", name.lower())
    digits = [part.lstrip("0") if index % 2 else part for index, part in enumerate(parts)]
    return [(len(part) if index % 2 else 0, part) for index, part in enumerate(digits)], name


def _escaped(character: str) -> str:
    return character.encode("unicode_escape").decode("ascii")


UNKNOWN = "–"
"""Printed for an unknown number."""


def decibels(value: float | None) -> str:
    """A PSNR [dB]: "21.23 dB"; infinite is "equal"."""
    return UNKNOWN if value is None or math.isnan(value) else "equal" if value == math.inf else f"{value:.2f} dB"


def percent(share: float | None) -> str:
    """A share of 0..1: "12 %", or "under 1 %" for a small share above 0."""
    if share is None or math.isnan(share):
        return UNKNOWN
    return f"{100 * share:.0f} %" if share >= 0.01 or share == 0 else "under 1 %"


def duration(seconds: float) -> str:
    """Seconds: "1.50 s"."""
    return f"{seconds:.2f} s"


def length(value: float, metric: bool) -> str:
    """A length: "2.20 m"; three significant digits if the unit is unknown."""
    if math.isnan(value):
        return UNKNOWN
    return f"{value:.2f} m" if metric else f"{value:.3g}"
