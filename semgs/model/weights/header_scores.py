"""Scores that the header of a weights file states."""

from __future__ import annotations

import json
from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass
from pathlib import Path

from semgs.files.errors import InputError
from semgs.files.records import make_record
from semgs.files.strict_json import parse_json
from semgs.model.weights.weights_file import read_header

KEY = "scores"
"""Key of a header, with JSON."""


@dataclass(frozen=True)
class Figure:
    """A measured number with its 95 % interval.

    Attributes:
        value: the number.
        low, high: ends of the interval; None without an interval.
    """

    value: float
    low: float | None = None
    high: float | None = None


@dataclass(frozen=True)
class Score:
    """Scores of weights on some data.

    Attributes:
        data: name of the data.
        protocol: which frames were compared.
        views: number of input views.
        targets: number of views that were compared.
        sha256: of the file that was scored. The file with these scores in its header has the same tensors, but another header.
        figures: by the metric's name in `report.json`: miou, psnr [dB], ...
    """

    data: str
    protocol: str
    views: int
    targets: int
    sha256: str
    figures: Mapping[str, Figure]


def scores_text(scores: Sequence[Score]) -> str:
    """Scores as text for a header."""
    return json.dumps([asdict(score) for score in scores])


def read_scores(path: str | Path) -> tuple[Score, ...]:
    """The scores in the header of a weights file; none if it states none.

    Raises:
        InputError: the file is not one of semgs, or its scores are invalid.
    """
    text = read_header(path).metadata.get(KEY, "[]")
    try:
        return tuple(make_record(Score, score) for score in parse_json(text))
    except (ValueError, TypeError) as error:
        raise InputError(path, "scores as JSON", f"{error}", key=KEY) from None
