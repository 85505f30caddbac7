"""Checks of a file to write, before long work starts."""

from __future__ import annotations

from pathlib import Path

from semgs.files.atomic import check_file
from semgs.files.errors import InputError


def check_new_file(path: Path, overwrite: bool | None = None) -> None:
    """Check that a file can be written, and replaced only if the user wants it.

    Args:
        path: the file.
        overwrite: whether --overwrite is given; None if the command has no such option.

    Raises:
        InputError: it exists, or cannot be written.
    """
    if path.exists() and not overwrite:
        advice = "choose another name" if overwrite is None else "use --overwrite to replace it"
        raise InputError(path, "a new file", "one that exists", advice=advice)
    check_file(path)
