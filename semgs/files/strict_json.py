"""JSON from files, read strictly: what a parser would let pass, or fall over, is a `ValueError` with one sentence."""

from __future__ import annotations

import json
from collections import Counter
from decimal import Decimal
from typing import Any

from semgs.files.errors import InputError
from semgs.files.stored import Stored, stored

DEEPEST = 100
"""Objects and lists nested more deeply than this are refused: walking them would exhaust Python's stack."""

FLOAT_DIGITS, MOST_DIGITS = 300, 1000
"""Whole numbers of more digits become `Decimal`, as no float holds them; of still more they are refused, as Python takes long to read them."""


def parse_json(text: str | bytes) -> Any:
    """The content of a JSON text, in UTF-8 (or what its byte order mark says) if it is bytes.

    A whole number that no float holds is a `Decimal`: no `int`, so that who reads numbers can refuse it and name its key.

    Raises:
        ValueError: it is no JSON, a key appears twice in one object, it is nested more than 100 levels deep, or a whole number has more
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
        expected: what it should hold, for the error.
        advice: likewise, what to do about it.

    Raises:
        InputError: it cannot be read, or as `parse_json`.
    """
    file = stored(path)
    try:
        return parse_json(file.read_bytes())
    except OSError as error:
        raise InputError(file, expected, error.strerror or str(error), advice=advice) from error
    except UnicodeDecodeError as error:
        raise InputError(file, f"{expected} in UTF-8", f"byte {error.start} that is not", advice=advice) from error
    except ValueError as error:
        raise InputError(file, expected, str(error), advice=advice) from error


_TOO_DEEP = f"objects or lists nested more than {DEEPEST} levels deep"


def _once_each(pairs: list[tuple[str, Any]]) -> dict[str, Any]:
    """An object of its keys and values.

    Raises:
        ValueError: a key appears twice.
    """
    content = dict(pairs)
    if len(content) < len(pairs):
        (key, _), *_ = Counter(key for key, _ in pairs).most_common(1)
        raise ValueError(f"the key {key!r:.60} twice in one object")
    return content


def _whole(digits: str) -> int | Decimal:
    """A whole number.

    Raises:
        ValueError: it is too long.
    """
    if len(digits) > MOST_DIGITS:
        raise ValueError(f"a whole number of {len(digits)} digits")
    return int(digits) if len(digits) <= FLOAT_DIGITS else Decimal(digits)
