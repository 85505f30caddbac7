"""Small files of ScanNet's exporters: matrices and fields in text, depth in PGM."""

from __future__ import annotations

import io
import re
from dataclasses import dataclass
from pathlib import Path

import cv2
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


@dataclass(frozen=True, slots=True)
class Pgm:
    """A 16-bit PGM, as an array file [height width] uint16.

    Attributes:
        path: of the file.
    """

    path: Path

    @property
    def name(self) -> str:
        """The file's name, as an array file."""
        return f"{self.path.stem}.npy"

    @property
    def suffix(self) -> str:
        """What `read_bytes` gives is in NumPy's format."""
        return ".npy"

    @property
    def size(self) -> tuple[int, int]:
        """(height, width) of the map [px].

        Raises:
            InputError: it cannot be read, or is no such file.
        """
        try:
            height, width = self._counts().shape
        except OSError as error:
            raise InputError(self.path, "a 16-bit PGM", str(error)) from error
        return height, width

    def is_file(self) -> bool:
        """Whether the file is there."""
        return self.path.is_file()

    def read_bytes(self) -> bytes:
        """The counts in NumPy's file format.

        Raises:
            OSError: the file cannot be read, is cut short, or is no such file.
        """
        file = io.BytesIO()
        np.save(file, self._counts())
        return file.getvalue()

    def _counts(self) -> np.ndarray:
        """The counts [height width] uint16.

        Raises:
            OSError: as `read_bytes`.
        """
        data = self.path.read_bytes()
        counts = cv2.imdecode(np.frombuffer(data, np.uint8), cv2.IMREAD_UNCHANGED) if data[:2] == b"P5" else None
        if counts is None or counts.dtype != np.uint16 or counts.ndim != 2:
            raise OSError("no complete 16-bit PGM")
        return np.asarray(counts)

    def __str__(self) -> str:
        return str(self.path)
