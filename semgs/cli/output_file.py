"""Checks of a file to write, before long work starts."""

from __future__ import annotations

from collections.abc import Iterable
from pathlib import Path

from semgs.files.atomic import check_file
from semgs.files.errors import InputError
from semgs.files.folders import check_apart


def check_new_file(path: Path, overwrite: bool | None = None, inputs: Iterable[str | Path | None] = ()) -> None:
    """Check that a file can be written, and replaced only if the user wants it.

    Args:
        path: the file.
        overwrite: whether --overwrite is given; None if the command has no such option.
        inputs: what will be read, as for `check_apart`.

    Raises:
        InputError: it exists, is an input, or cannot be written.
    """
    check_apart(path, inputs)
    if path.exists() and not overwrite:
        advice = "choose another name" if overwrite is None else "use --overwrite to replace it"
        raise InputError(path, "a new file", "one that exists", advice=advice)
    check_file(path)
