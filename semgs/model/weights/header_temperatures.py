"""Temperatures in the header of a weights file; `semgs.rendering.temperatures` explains what a temperature is."""

from __future__ import annotations

import json
from collections.abc import Mapping
from dataclasses import asdict
from pathlib import Path

from semgs.files.errors import InputError
from semgs.files.records import make_record
from semgs.files.strict_json import parse_json
from semgs.model.weights.weights_file import read_header
from semgs.rendering.temperatures import Temperatures

KEY = "temperatures"
"""Key of a header, with JSON."""

DIGITS = 3
"""Decimal places of a temperature in a header."""


def temperatures_text(temperatures: Temperatures) -> str:
    """Temperatures as text for a header."""
    return json.dumps({kind: round(value, DIGITS) for kind, value in asdict(temperatures).items()})


def read_temperatures(path: str | Path) -> Temperatures | None:
    """The temperatures in the header of a weights file; None if it states none.

    Raises:
        InputError: the file is not one of semgs, or a temperature is not a positive number.
    """
    return temperatures_in(read_header(path).metadata, path)


def temperatures_in(metadata: Mapping[str, str], path: str | Path) -> Temperatures | None:
    """The temperatures in the metadata of a header that was read from `path`; None if it states none.

    Raises:
        InputError: a temperature is not a positive number.
    """
    text = metadata.get(KEY)
    if text is None:
        return None
    try:
        return make_record(Temperatures, parse_json(text))
    except ValueError as error:
        raise InputError(path, "temperatures as JSON", f"{error}", key=KEY) from None
