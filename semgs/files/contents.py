"""The content of a file, or an error that names it; and hashes of content."""

from __future__ import annotations

import hashlib
from pathlib import Path
from typing import TYPE_CHECKING

from semgs.files.errors import InputError
from semgs.files.stored import Stored, stored

if TYPE_CHECKING:
    import numpy as np

LFS_POINTER = b"version https://git-lfs.github.com/spec/"
"""How the text begins that Git LFS leaves in place of a file that it has not fetched yet."""

CHECKPOINTS = (".pt", ".pth", ".ckpt")
"""Endings of checkpoints of trainings: pickles, which may run anything and are not read as splats or scenes."""


def refuse_checkpoint(path: Path, expected: str) -> None:
    """Refuse the checkpoint of a training of Gaussians.

    Args:
        path: the file.
        expected: what it should be, for the error.

    Raises:
        InputError: it is a file with the ending of one.
    """
    if path.suffix.lower() in CHECKPOINTS and path.is_file():
        advice = "export a PLY with the program that trained it (nerfstudio: ns-export gaussian-splat; gsplat: export_splats)"
        raise InputError(path, expected, "a training checkpoint", advice=advice)


def check_fetched(path: str | Stored, beginning: bytes, expected: str) -> None:
    """Refuse what Git LFS leaves in place of a file.

    Args:
        path: the file.
        beginning: at least its first `len(LFS_POINTER)` bytes.
        expected: what it should be, for the error.

    Raises:
        InputError: it is a pointer of Git LFS.
    """
    if beginning.startswith(LFS_POINTER):
        raise InputError(path, expected, "a Git LFS pointer, not the file", advice="run git lfs pull")


def read_bytes(path: str | Stored, expected: str = "a file that can be read", advice: str | None = None) -> bytes:
    """The bytes of a file.

    Args:
        path: the file.
        expected: what it should be, for the error.
        advice: what to do about it, likewise.

    Raises:
        InputError: it cannot be read, or Git LFS has not fetched it.
    """
    file = stored(path)
    try:
        data = file.read_bytes()
    except OSError as error:
        raise InputError(file, expected, error.strerror or str(error), advice=advice) from error
    check_fetched(file, data, expected)
    return data


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
    return hashlib.sha256(head + values.tobytes()).hexdigest()
