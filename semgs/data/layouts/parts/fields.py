"""Values of a JSON file by key, with errors that name the key."""

from __future__ import annotations

import contextlib
import math
import re
from dataclasses import dataclass
from typing import Any

import numpy as np

from semgs.files.errors import InputError
from semgs.files.stored import Stored
from semgs.files.strict_json import read_json

_NUMBER = re.compile(r"[-+]?(?:[0-9]++(?:\.[0-9]*+)?|\.[0-9]++)(?:[eE][-+]?[0-9]++)?")
"""A number in a text. `float` also takes others, such as 1_2."""


def read_fields(path: Stored) -> Fields:
    """The object in a JSON file.

    Raises:
        InputError: it cannot be read, is not JSON, or contains something other than an object.
    """
    content = read_json(path)
    if not isinstance(content, dict):
        raise InputError(path, "a JSON object", f"a {type(content).__name__}")
    return Fields(path, content)


@dataclass(frozen=True)
class Fields:
    """An object of a JSON file. Missing keys, and null, are looked up in the object around it.

    Attributes:
        path: the file.
        values: its keys and values.
        place: where it is in the file ("frames[3]."), as the start of a key.
        around: the object to look up missing keys in, or None.
    """

    path: Stored
    values: dict[str, Any]
    place: str = ""
    around: Fields | None = None

    def holder(self, *keys: str) -> Fields | None:
        """The innermost object that has one of these keys."""
        if any(self.values.get(key) is not None for key in keys):
            return self
        return self.around.holder(*keys) if self.around else None

    def value(self, key: str) -> Any:
        """The value of a key, None if there is none."""
        holder = self.holder(key)
        return holder.values[key] if holder else None

    def required(self, key: str, expected: str = "a number") -> float:
        """A finite number.

        Args:
            key: of the number.
            expected: what it is, for the error.

        Raises:
            InputError: it is missing or something else.
        """
        number = self.number(key)
        if number is None:
            raise self.refused(key, expected, "nothing")
        return number

    def size(self, width: str, height: str) -> tuple[int, int] | None:
        """(height, width) from the keys of the two, None if one is missing.

        Raises:
            InputError: one is not a positive integer.
        """
        columns, rows = self.whole(width), self.whole(height)
        return None if columns is None or rows is None else (rows, columns)

    def number(self, key: str) -> float | None:
        """A finite number, None if missing. Some programs write numbers as text ("0.5").

        Raises:
            InputError: it is something else.
        """
        value = self.value(key)
        if value is None:
            return None
        number = math.nan
        if isinstance(value, int | float) and not isinstance(value, bool):
            with contextlib.suppress(OverflowError):  # a whole number beyond the largest float
                number = float(value)
        elif isinstance(value, str) and _NUMBER.fullmatch(value.strip()):
            number = float(value)
        if not math.isfinite(number):
            raise self.refused(key, "a finite number", f"{value!r:.40}")
        return number

    def flag(self, key: str) -> bool:
        """Whether a key is set to something else than false, 0 or nothing, also as text ("0.0", "false")."""
        value = self.value(key)
        if isinstance(value, str):
            text = value.strip().lower()
            return float(text) != 0 if _NUMBER.fullmatch(text) else text not in ("", "false", "none", "null")
        return bool(value)

    def positive(self, key: str) -> float | None:
        """A number above 0, None if missing.

        Raises:
            InputError: it is something else.
        """
        number = self.number(key)
        if number is not None and number <= 0:
            raise self.refused(key, "a number above 0", f"{number:g}")
        return number

    def whole(self, key: str) -> int | None:
        """A positive integer, None if missing.

        Raises:
            InputError: it is something else.
        """
        number = self.positive(key)
        if number is not None and not number.is_integer():
            raise self.refused(key, "a whole number", f"{number:g}")
        return None if number is None else int(number)

    def array(self, key: str, dtype: type = np.float64) -> np.ndarray | None:
        """The numbers of a list, or of lists in lists, as an array; None for anything else, and if missing."""
        value = self.value(key)
        try:
            return np.array(value, dtype) if isinstance(value, list) else None
        except (TypeError, ValueError, OverflowError):
            return None

    def text(self, key: str) -> str | None:
        """A non-empty text, None if missing.

        Raises:
            InputError: it is something else.
        """
        value = self.value(key)
        if value is not None and (not isinstance(value, str) or not value.strip() or "\0" in value):
            raise self.refused(key, "a text", repr(value))
        return value

    def objects(self, key: str) -> list[Fields]:
        """A non-empty list of objects; they look up missing keys in this one.

        Raises:
            InputError: it is missing or something else.
        """
        values = self.value(key)
        if not isinstance(values, list) or not values:
            raise self.refused(key, "a list of objects", "nothing" if values is None else f"{values!r:.40}")
        for index, value in enumerate(values):
            if not isinstance(value, dict):
                raise InputError(self.path, "an object", f"{value!r:.40}", f"{self.place}{key}[{index}]")
        return [Fields(self.path, value, f"{self.place}{key}[{index}].", self) for index, value in enumerate(values)]

    def refused(self, key: str, expected: str, found: str, advice: str | None = None) -> InputError:
        """The error for a value, with its place."""
        return InputError(self.path, expected, found, self.key(key), advice)

    def key(self, key: str) -> str:
        """The place of a key in the file: in the object that has it, or else in this one."""
        return f"{(self.holder(key) or self).place}{key}"
