"""The content of a file, or an error that names it."""

from __future__ import annotations

from semgs.files.errors import InputError
from semgs.files.stored import Stored, stored


def read_bytes(path: str | Stored, expected: str = "a file that can be read", advice: str | None = None) -> bytes:
    """The bytes of a file.

    Args:
        path: the file.
        expected: what it should be, for the error.
        advice: what to do about it, likewise.

    Raises:
        InputError: it cannot be read.
    """
    file = stored(path)
    try:
        return file.read_bytes()
    except OSError as error:
        raise InputError(file, expected, error.strerror or str(error), advice=advice) from error


def read_text(path: str | Stored, expected: str = "a text file in UTF-8") -> str:
    """The text of a file in UTF-8, without a byte order mark.

    Args:
        path: the file.
        expected: what it should be, for the error.

    Raises:
        InputError: it cannot be read, or is not UTF-8.
    """
    data = read_bytes(path, expected)
    try:
        return data.decode("utf-8-sig")
    except UnicodeDecodeError as error:
        raise InputError(path, expected, f"byte {error.start}, which is not UTF-8") from error
