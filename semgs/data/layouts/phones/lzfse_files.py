"""Maps that are compressed with LZFSE, Apple's format, as `.npy` files. Read with lzfse."""

from __future__ import annotations

import errno
import io
from dataclasses import dataclass
from importlib.util import find_spec

import numpy as np

from semgs.files.stored import Stored

_FRAMING = 64
"""More bytes than LZFSE adds to a map that it cannot compress."""


@dataclass(frozen=True, slots=True)
class LzfseFile:
    """A map, row by row, as a `.npy` file.

    Attributes:
        compressed: the file.
        size: (height, width) of the map.
        dtype: NumPy's name of its numbers.
    """

    compressed: Stored
    size: tuple[int, int]
    dtype: str = "<f4"

    @property
    def name(self) -> str:
        """The name without folders."""
        return self.compressed.name

    @property
    def suffix(self) -> str:
        """That of NumPy's files."""
        return ".npy"

    def is_file(self) -> bool:
        """Whether it exists."""
        return self.compressed.is_file()

    def read_bytes(self) -> bytes:
        """The `.npy` file.

        Raises:
            OSError: it cannot be read, is damaged, or has another size.
        """
        import lzfse

        expected = self.size[0] * self.size[1] * np.dtype(self.dtype).itemsize
        try:
            data = self.compressed.read_bytes()
            # A longer file than its content is none of ours, and might inflate to any length.
            content = lzfse.decompress(data) if len(data) < expected + _FRAMING else b""
        except lzfse.error as error:
            raise OSError(errno.EIO, "damaged: it is not LZFSE") from error
        if len(content) != expected:
            said = f"not a map of {self.size[1]}x{self.size[0]} (width x height), which has {expected} bytes"
            raise OSError(errno.EIO, said)
        buffer = io.BytesIO()
        np.save(buffer, np.frombuffer(content, self.dtype).reshape(self.size))
        return buffer.getvalue()

    def __str__(self) -> str:
        return str(self.compressed)


def can_inflate() -> bool:
    """Whether lzfse is installed (`pip install '.[phone]'`)."""
    return find_spec("lzfse") is not None
