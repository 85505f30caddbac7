"""Writes a file for `--correspondence`, as somebody who follows docs/segmenters.md does."""

from __future__ import annotations

import json
from collections.abc import Mapping, Sequence
from dataclasses import asdict
from pathlib import Path

from semgs.data.tables.classes import SCANNET20, ClassTable


def write_correspondence(
    path: Path,
    theirs: Sequence[str],
    table: Sequence[Sequence[float]],
    *,
    classes: ClassTable = SCANNET20,
    votes: Mapping[str, Sequence[float]] | None = None,
) -> Path:
    """Say of each of a network's classes how much it is each of ours."""
    content = {
        "format": "semgs.correspondence", "version": 1, "segmenter": "net", "theirs": list(theirs), "classes": asdict(classes),
        "table": [[float(share) for share in row] for row in table], "votes": votes,
    }  # fmt: skip
    path.write_text(json.dumps(content))
    return path
