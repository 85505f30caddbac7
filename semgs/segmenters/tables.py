"""Class tables from names alone."""

from __future__ import annotations

import colorsys
from collections.abc import Sequence
from dataclasses import replace

from semgs.data.tables.classes import IGNORE, SCANNET20, ClassTable

GOLDEN = 0.618034
"""Step between hues, so that neighbours in a table differ."""

NOTHING = "none of these"
"""The class of pixels that no word of a user describes."""

GREY = (205, 205, 205)
"""Its colour, so that the words stand out."""


def make_class_table(name: str, names: Sequence[str]) -> ClassTable:
    """A class table with colours from a fixed scheme; ScanNet's names keep their colours.

    Raises:
        ValueError: as `ClassTable`.
    """
    if tuple(names) == SCANNET20.names:
        return SCANNET20
    known = dict(zip(SCANNET20.names, SCANNET20.colours, strict=True))
    colours = tuple(known.get(one) or _colour(place) for place, one in enumerate(names))
    return ClassTable(name, tuple(names), colours, tuple(range(len(names))))


def make_word_table(words: Sequence[str]) -> ClassTable:
    """The table of words that a user gave, and of `NOTHING` behind them.

    Raises:
        ValueError: there are no words, one is empty, or two are equal but for case and spaces.
    """
    plain = [" ".join(word.split()).lower() for word in words]
    if not all(plain):
        raise ValueError("expected words, found an empty one")
    twice = next((word for place, word in enumerate([*plain, NOTHING]) if word in plain[:place]), None)
    if twice is not None:
        raise ValueError(f"expected different words, found {twice!r} twice")
    if not 0 < len(plain) < IGNORE:
        raise ValueError(f"expected 1 to {IGNORE - 1} words, found {len(plain)}")
    found = make_class_table("words", (*words, NOTHING))
    return replace(found, colours=(*found.colours[:-1], GREY))


def _colour(place: int) -> tuple[int, int, int]:
    """The colour of a place in a table: hues a golden section apart, in three strengths."""
    red, green, blue = colorsys.hsv_to_rgb(place * GOLDEN % 1, 0.55 + 0.15 * (place % 3), 0.9 - 0.15 * (place // 3 % 3))
    return round(255 * red), round(255 * green), round(255 * blue)
