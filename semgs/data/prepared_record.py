"""The record in a prepared scene: what it was made of."""

from __future__ import annotations

from pathlib import Path
from typing import Any

from semgs.files.archives import members
from semgs.files.strict_json import parse_json

RECORD = "prepared.json"


def read_record(archive: Path) -> dict[str, Any] | None:
    """What `prepared.json` in an archive holds; None where the archive is not one of ours.

    Raises:
        InputError: it is no zip archive.
    """
    member = members(archive).get(RECORD)
    try:
        content = parse_json(member.read_bytes()) if member is not None else None
    except (OSError, ValueError):
        return None
    return content if isinstance(content, dict) else None
