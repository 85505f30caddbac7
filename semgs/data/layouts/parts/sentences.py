"""Sentences about frames that lack something."""

from __future__ import annotations

from collections.abc import Sequence


def lacking(names: Sequence[str], count: int, what: str) -> list[str]:
    """A sentence about some of `count` frames: how many, what they lack, and the first of them. None if there are no names.

    Args:
        names: of those frames.
        count: of all frames.
        what: the rest of the sentence ("frames have no depth").
    """
    return [f"{len(names)} of {count} {what}, the first is {names[0]}."] if names else []


def on_white(count: int) -> list[str]:
    """A sentence about pictures with transparent areas, if there are any."""
    return [f"{count} pictures have an alpha channel; where transparent they are laid on white."] if count else []
