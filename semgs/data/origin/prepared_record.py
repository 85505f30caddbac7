"""The record in a prepared scene: what it was made from."""

from __future__ import annotations

from pathlib import Path
from typing import Any

from semgs.files.archives import members
from semgs.files.strict_json import parse_json

RECORD = "prepared.json"


def read_record(archive: Path) -> dict[str, Any] | None:
    """The content of `prepared.json` in an archive; None if it is not a prepared scene.

    Raises:
        InputError: it is not a zip archive.
    """
    member = members(archive).get(RECORD)
    try:
        content = parse_json(member.read_bytes()) if member is not None else None
    except (OSError, ValueError):
        return None
    return content if isinstance(content, dict) else None
