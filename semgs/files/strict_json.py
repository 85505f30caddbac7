"""Strict JSON: duplicate keys, deep nesting and huge numbers are one-line ValueErrors."""

from __future__ import annotations

import json
from collections import Counter
from decimal import Decimal
from typing import Any

from semgs.files.contents import read_bytes
from semgs.files.errors import InputError
from semgs.files.stored import Stored

DEEPEST = 100
"""Deeper nesting is refused, because walking it would exhaust Python's stack."""

FLOAT_DIGITS, MOST_DIGITS = 300, 1000
"""Integers with more digits than the first become `Decimal`, as no float can hold them. More than the second are refused, as parsing is slow."""


def parse_json(text: str | bytes) -> Any:
    """The content of a JSON text; bytes are UTF-8, or what the byte order mark says.

    An integer too large for a float becomes a `Decimal`, so callers that expect numbers can refuse it and name its key.

    Raises:
        ValueError: it is not JSON, a key appears twice in one object, nesting is deeper than 100 levels, or an integer has more
            than 1,000 digits.
    """
    if isinstance(text, bytes):
        text = text.decode(json.detect_encoding(text))
    try:
        content = json.loads(text.removeprefix("\ufeff"), object_pairs_hook=_once_each, parse_int=_whole)
    except json.JSONDecodeError as error:
        raise ValueError(f"{error.msg} in line {error.lineno}, column {error.colno}") from error
    except RecursionError:
        raise ValueError(_TOO_DEEP) from None
    level = [content]
    for _ in range(DEEPEST + 1):
        containers = [one.values() if isinstance(one, dict) else one for one in level if isinstance(one, dict | list)]
        if not containers:
            return content
        level = [inner for one in containers for inner in one]
    raise ValueError(_TOO_DEEP)


def read_json(path: str | Stored, expected: str = "JSON", advice: str | None = None) -> Any:
    """The content of a JSON file.

    Args:
        path: the file.
        expected: what it should contain, for the error.
        advice: what the user can do, likewise.

    Raises:
        InputError: it cannot be read, or is refused by `parse_json`.
    """
    data = read_bytes(path, expected, advice)
    try:
        return parse_json(data)
    except UnicodeDecodeError as error:
        raise InputError(path, f"{expected} in UTF-8", f"byte {error.start} that is not", advice=advice) from error
    except ValueError as error:
        raise InputError(path, expected, str(error), advice=advice) from error


_TOO_DEEP = f"objects or lists nested more than {DEEPEST} levels deep"


def _once_each(pairs: list[tuple[str, Any]]) -> dict[str, Any]:
    """An object from its keys and values, each key once."""
    content = dict(pairs)
    if len(content) < len(pairs):
        (key, _), *_ = Counter(key for key, _ in pairs).most_common(1)
        raise ValueError(f"the key {key!r:.60} twice in one object")
    return content


def _whole(digits: str) -> int | Decimal:
    """An integer."""
    if len(digits) > MOST_DIGITS:
        raise ValueError(f"a whole number of {len(digits)} digits")
    return int(digits) if len(digits) <= FLOAT_DIGITS else Decimal(digits)
