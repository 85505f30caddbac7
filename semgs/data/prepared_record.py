"""The record in a prepared scene: what it was made of."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

from semgs.files.archives import members

RECORD = "prepared.json"


def read_record(archive: Path) -> dict[str, Any] | None:
    """What `prepared.json` in an archive holds; None where the archive is not one of ours.

    Raises:
        InputError: it is no zip archive.
    """
    member = members(archive).get(RECORD)
    try:
        content = json.loads(member.read_bytes()) if member is not None else None
    except (OSError, ValueError):
        return None
    return content if isinstance(content, dict) else None
