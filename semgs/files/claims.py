"""Folders that a command fills over several calls. A record in the folder stores the settings, so that calls cannot mix."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any

from semgs.files.atomic import is_part_of
from semgs.files.errors import InputError
from semgs.files.folders import check_name
from semgs.files.strict_json import read_json


def is_begun(record: Path, settings: Mapping[str, Any], what: str) -> bool:
    """Whether a folder already contains work with these settings; False if it is new or empty.

    Args:
        record: the JSON file in the folder that stores the settings.
        settings: the requested ones, as JSON returns them.
        what: what such a folder is ("a prepared set"), for messages.

    Raises:
        ValueError: the folder was made with other settings; the error lists the differences.
        InputError: it contains something else, the record cannot be read, or a new folder has the name of a file.
    """
    folder = record.parent
    if not record.is_file():
        if folder.is_symlink() and not folder.exists():
            raise InputError(folder, f"a new or empty folder, or {what} to resume", "a broken link")
        if folder.exists() and not (folder.is_dir() and all(is_part_of(file, record) for file in folder.iterdir())):
            raise InputError(
                folder, f"a new or empty folder, or {what} to resume", "something else", advice="name another folder"
            )  # fmt: skip
        check_name(folder)
        return False
    there = read_json(record, f"the settings of {what}")
    if not isinstance(there, dict) or set(there) != set(settings):
        raise InputError(record, f"the settings of {what}", "something else", advice="name another folder")
    other = [f"{name} is {there[name]} there, not {value}" for name, value in settings.items() if there[name] != value]
    if other:
        raise ValueError(
            f"{folder} is {what} with other settings: {'; '.join(other)}; use the same settings or another folder"
        )
    return True
