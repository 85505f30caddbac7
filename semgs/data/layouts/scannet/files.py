"""Small files of ScanNet's exporters: matrices and fields in text."""

from __future__ import annotations

import re
from pathlib import Path

import numpy as np
from jaxtyping import Float64

from semgs.files.errors import InputError


def read_text(path: Path) -> str:
    """A small text file, whatever its line ends.

    Raises:
        InputError: it cannot be read, or is no text.
    """
    try:
        return path.read_bytes().decode("utf-8-sig")
    except OSError as error:
        raise InputError(path, "a readable file", error.strerror or str(error)) from error
    except UnicodeDecodeError as error:
        raise InputError(path, "a text file", "something else") from error


def read_numbers(path: Path) -> Float64[np.ndarray, " n"]:
    """The numbers of a text file, with spaces, commas or line ends between them; `inf` and `nan` are numbers here.

    Raises:
        InputError: it cannot be read, or holds something else.
    """
    words = re.split(r"[\s,]+", read_text(path).strip())
    try:
        return np.array([float(word) for word in words if word], np.float64)
    except ValueError as error:
        raise InputError(path, "numbers", str(error)) from error


def read_fields(path: Path) -> dict[str, str]:
    """The lines `key = value` of a text file.

    Raises:
        InputError: it cannot be read.
    """
    pairs = (line.split("=", 1) for line in read_text(path).splitlines() if "=" in line)
    return {key.strip(): value.strip() for key, value in pairs}
