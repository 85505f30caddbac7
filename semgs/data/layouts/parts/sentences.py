"""Notes about frames that lack something."""

from __future__ import annotations

from collections.abc import Sequence

from semgs.files.errors import InputError
from semgs.files.text import counted


def note_lacking(names: Sequence[str], count: int, what: str) -> list[str]:
    """A note: how many of `count` frames lack something, and the first of them. Empty if there are none.

    Args:
        names: of those frames.
        count: of all frames.
        what: what they lack ("frames have no depth").
    """
    return [f"{len(names)} of {count} {what}, the first is {names[0]}."] if names else []


def note_transparent(count: int, masks: str) -> list[str]:
    """A note about images with transparent areas, if there are any.

    Args:
        count: how many.
        masks: where the layout has masks ("mask_path of its frame").
    """
    if not count:
        return []
    images = counted(count, "image has", "images have")
    return [
        f"{images} an alpha channel; transparent areas become white. To hide them, write a mask of each image (black = hidden): {masks}."
    ]


def note_damaged_points(error: InputError | None) -> list[str]:
    """A note about sparse points that cannot be read, if so; a scene does not need them."""
    return [f"The sparse points are left out: {error}."] if error else []
