"""Temperatures in the header of a weights file; `semgs.objectives.calibration` explains what a temperature is."""

from __future__ import annotations

import json
import math
from collections.abc import Mapping
from pathlib import Path

from semgs.files.errors import InputError
from semgs.files.strict_json import parse_json
from semgs.weights.file import read_header

KEY = "temperatures"
"""Key of a header, with JSON."""

DIGITS = 3
"""Decimal places of a temperature in a header."""

KINDS = ("rendered", "gaussians")
"""What has its own temperature: rendered pixels, and single Gaussians."""


def temperatures_text(temperatures: Mapping[str, float]) -> str:
    """Temperatures as text for a header."""
    return json.dumps({kind: round(temperatures[kind], DIGITS) for kind in KINDS})


def read_temperatures(path: str | Path) -> dict[str, float] | None:
    """The temperatures in the header of a weights file; None if it states none.

    Raises:
        InputError: the file is not one of semgs, or a temperature is not a positive number.
    """
    return temperatures_in(read_header(path).metadata, path)


def temperatures_in(metadata: Mapping[str, str], path: str | Path) -> dict[str, float] | None:
    """The temperatures in the metadata of a header that was read from `path`; None if it states none.

    Raises:
        InputError: a temperature is not a positive number.
    """
    text = metadata.get(KEY)
    if text is None:
        return None
    try:
        held = parse_json(text)
        found = {kind: float(held[kind]) for kind in KINDS}
    except (ValueError, TypeError, KeyError) as error:
        raise InputError(path, "temperatures as JSON", f"{type(error).__name__}: {error}", key=KEY) from None
    for kind, value in found.items():
        if not 0 < value < math.inf:
            raise InputError(path, "a temperature above 0", f"{value}", key=f"{KEY}.{kind}")
    return found
