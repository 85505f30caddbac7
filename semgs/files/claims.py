"""Folders that are filled by one command, call after call: whose they are, by the settings that a record in them keeps."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any

from semgs.files.atomic import is_part_of
from semgs.files.errors import InputError
from semgs.files.strict_json import read_json


def is_begun(record: Path, settings: Mapping[str, Any], what: str) -> bool:
    """Whether a folder holds work of these settings already; False if it is free to begin in.

    Args:
        record: the JSON file in the folder that keeps the settings.
        settings: those that are asked for, as JSON gives them back.
        what: the folder is then, such as "a prepared set", for messages.

    Raises:
        ValueError: the folder holds work of other settings; each that differs is named.
        InputError: it holds something else, or the record cannot be read.
    """
    folder = record.parent
    if not record.is_file():
        if folder.exists() and not (folder.is_dir() and all(is_part_of(file, record) for file in folder.iterdir())):
            raise InputError(
                folder, f"a new or empty folder, or {what} to go on with", "something else", advice="name another folder"
            )  # fmt: skip
        return False
    there = read_json(record, f"the settings of {what}")
    if not isinstance(there, dict) or set(there) != set(settings):
        raise InputError(record, f"the settings of {what}", "something else", advice="name another folder")
    other = [
        f"{name} is {there[name]} there, {asked} asked" for name, asked in settings.items() if there[name] != asked
    ]
    if other:
        raise ValueError(
            f"{folder} is {what} of other settings: {'; '.join(other)}; give the same ones or name another folder"
        )
    return True
