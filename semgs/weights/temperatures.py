"""Temperatures: what a file of weights says of how sure to be (`semgs.objectives.calibration` tells what a temperature is)."""

from __future__ import annotations

import json
import math
from collections.abc import Mapping
from pathlib import Path

from semgs.files.errors import InputError
from semgs.files.strict_json import parse_json
from semgs.weights.file import read_header

KEY = "temperatures"
"""Where a header has them, as JSON."""

DIGITS = 3
"""Decimal places of a temperature in a header."""

KINDS = ("rendered", "gaussians")
"""What has a temperature of its own: pixels after splatting, and single Gaussians."""


def temperatures_text(temperatures: Mapping[str, float]) -> str:
    """Temperatures as a header keeps them."""
    return json.dumps({kind: round(temperatures[kind], DIGITS) for kind in KINDS})


def read_temperatures(path: str | Path) -> dict[str, float] | None:
    """The temperatures that the header of a file of weights has; None where it says nothing.

    Raises:
        InputError: the file is none of ours, or they are not one positive number each.
    """
    return temperatures_in(read_header(path).metadata, path)


def temperatures_in(metadata: Mapping[str, str], path: str | Path) -> dict[str, float] | None:
    """As `read_temperatures`, from the metadata of a header that was read from `path`.

    Raises:
        InputError: they are not one positive number each.
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
