"""Safetensors files, opened with care: a crafted header must neither keep us busy nor be read in two ways."""

from __future__ import annotations

import struct
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

from safetensors import SafetensorError, safe_open

from semgs.files.errors import InputError
from semgs.files.strict_json import parse_json

LONGEST_HEADER = 8 * 2**20
"""Bytes of a header that are parsed. The longest of ours, with the names of thousands of scenes, are a tenth of it; 80 MB take half a minute."""


@contextmanager
def opened_tensors(path: str | Path, expected: str) -> Iterator[Any]:
    """A safetensors file, open for as long as the block lasts; its tensors are torch's.

    Args:
        path: the file.
        expected: what it should be, for the error.

    Yields:
        What `safetensors.safe_open` gives.

    Raises:
        InputError: it cannot be read, is no safetensors file or not a complete one, or its header is longer than 8 MiB or no JSON as
            `parse_json` takes it.
    """
    try:
        with Path(path).open("rb") as file:
            (length,) = struct.unpack("<Q", file.read(8).ljust(8, b"\0"))
            if length > LONGEST_HEADER:
                raise InputError(path, expected, f"a header of {length:,} bytes; at most {LONGEST_HEADER:,} are read")
            header = file.read(length)
        with safe_open(path, "pt") as opened:
            _check(path, header, expected)
            yield opened
    except (OSError, SafetensorError) as error:
        raise InputError(path, expected, str(error)) from None


def _check(path: str | Path, header: bytes, expected: str) -> None:
    """Refuse a header that says a thing twice.

    Raises:
        InputError: it does, or is no JSON as `parse_json` takes it.
    """
    try:
        parse_json(header)
    except ValueError as error:
        raise InputError(path, expected, str(error), key="header") from None
