"""Text that others wrote (names of files, scenes, classes), made safe to show."""

from __future__ import annotations

from collections.abc import Sequence


def printable(text: str) -> str:
    """The text with a backslash escape for each character that a terminal would obey or cannot show; line ends stay.

    These are control characters (colours, cursor movements, titles), invisible characters that reorder text, and the bytes of
    file names that are no UTF-8, which Python keeps as lone surrogates.
    """
    if text.isprintable():
        return text
    return "".join(one if one.isprintable() or one == "\n" else _escaped(one) for one in text)


def listed(names: Sequence[str], most: int = 5) -> str:
    """Names on a line: the first ones, and how many more."""
    rest = len(names) - most
    return ", ".join(names[:most]) + (f" and {rest} more" if rest > 0 else "")


def _escaped(character: str) -> str:
    return character.encode("unicode_escape").decode("ascii")
