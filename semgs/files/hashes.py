"""Hashes of files."""

from __future__ import annotations

import hashlib
from pathlib import Path

import numpy as np


def sha256(path: str | Path) -> str:
    """The SHA-256 of a file's bytes, in hexadecimal.

    Raises:
        OSError: it cannot be read.
    """
    with Path(path).open("rb") as file:
        return hashlib.file_digest(file, "sha256").hexdigest()


def sha256_of(values: np.ndarray) -> str:
    """The SHA-256 of an array's shape, type and numbers, in hexadecimal."""
    head = f"{values.shape} {values.dtype.str} ".encode()
    return hashlib.sha256(head + np.ascontiguousarray(values).tobytes()).hexdigest()
