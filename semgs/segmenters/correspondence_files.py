"""Files that say what a segmenter's classes mean in ours, and how much it and the network should each vote."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import numpy as np

from semgs.data.tables.classes import ClassTable
from semgs.files.errors import InputError
from semgs.files.records import make_record
from semgs.files.strict_json import read_json
from semgs.segmenters.labelling import ClassVotes
from semgs.segmenters.names import Correspondence

FORMAT = "semgs.correspondence"
VERSION = 1


@dataclass(frozen=True)
class StatedMeaning:
    """What a file says about a segmenter.

    Attributes:
        segmenter: name of it.
        theirs: its class names, in order.
        correspondence: from its classes to ours.
        votes: of it and a network; None if the file does not say.
    """

    segmenter: str
    theirs: tuple[str, ...]
    correspondence: Correspondence
    votes: ClassVotes | None = None


def read_correspondence(path: Path) -> StatedMeaning:
    """Read a file; docs/segmenters.md shows how one is made.

    Raises:
        InputError: it is missing or damaged.
    """
    expected = "a correspondence of classes, as in docs/segmenters.md"
    content = read_json(path, expected)
    if not isinstance(content, dict) or content.get("format") != FORMAT or content.get("version") != VERSION:
        raise InputError(path, expected, "another file")
    try:
        classes = make_record(ClassTable, content["classes"])
        table = np.array(content["table"], dtype=np.float32)
        theirs = tuple(str(name) for name in content["theirs"])
        if table.shape != (len(theirs), len(classes)) or not np.isfinite(table).all() or table.min() < 0:
            raise ValueError(f"table is {table.shape}")
        votes = content["votes"] and ClassVotes(
            **{key: tuple(map(float, row)) for key, row in content["votes"].items()}
        )
        if votes and any(len(row) != len(classes) for row in (votes.theirs, votes.own, votes.bias)):
            raise ValueError(f"votes are not of {len(classes)} classes")
        return StatedMeaning(str(content["segmenter"]), theirs, Correspondence(table, classes), votes)
    except (KeyError, TypeError, ValueError, AttributeError) as error:
        raise InputError(path, expected, f"{type(error).__name__}: {error}") from error
