"""Scores: what weights reached, where, as their header tells it."""

from __future__ import annotations

import json
from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass
from pathlib import Path

from semgs.files.errors import InputError
from semgs.files.strict_json import parse_json
from semgs.weights.file import read_header

KEY = "scores"
"""Where a header has them, as JSON."""


@dataclass(frozen=True)
class Figure:
    """A measured number with its 95 % interval.

    Attributes:
        value: the number.
        low, high: ends of the interval; None where it has none.
    """

    value: float
    low: float | None = None
    high: float | None = None


@dataclass(frozen=True)
class Score:
    """What weights reached on some data.

    Attributes:
        data: what these are called.
        protocol: which frames were compared.
        views: the number of input views.
        targets: how many views were compared.
        sha256: of the file that was scored. The file whose header has the score holds the same tensors, but another header.
        figures: by the metric's name in `report.json`: miou, psnr [dB], ...
    """

    data: str
    protocol: str
    views: int
    targets: int
    sha256: str
    figures: Mapping[str, Figure]


def scores_text(scores: Sequence[Score]) -> str:
    """Scores as a header keeps them."""
    return json.dumps([asdict(one) for one in scores])


def read_scores(path: str | Path) -> tuple[Score, ...]:
    """The scores that the header of a file of weights has; none where it says nothing.

    Raises:
        InputError: the file is none of ours, or its scores are not of this form.
    """
    text = read_header(path).metadata.get(KEY, "[]")
    try:
        return tuple(
            Score(**{**one, "figures": {name: Figure(**figure) for name, figure in one["figures"].items()}})
            for one in parse_json(text)
        )
    except (ValueError, TypeError, KeyError, AttributeError) as error:
        raise InputError(path, "scores as JSON", f"{type(error).__name__}: {error}", key=KEY) from None
