"""Maps that are compressed with LZFSE, Apple's format, as `.npy` files. Read with lzfse."""

from __future__ import annotations

import ctypes
import errno
import io
from dataclasses import dataclass
from importlib.util import find_spec
from typing import ClassVar

import numpy as np

from semgs.files.images.pictures import MOST_PIXELS
from semgs.files.stored import Stored

_END = b"bvx$"
"""The last bytes of LZFSE data."""

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
    suffix: ClassVar[str] = ".npy"

    @property
    def name(self) -> str:
        """The name without folders."""
        return self.compressed.name

    def is_file(self) -> bool:
        """Whether it exists."""
        return self.compressed.is_file()

    def read_bytes(self) -> bytes:
        """The `.npy` file.

        Raises:
            OSError: it cannot be read, is damaged, or has another size.
        """
        if self.size[0] * self.size[1] > MOST_PIXELS:
            raise OSError(
                errno.EFBIG, f"a map of {self.size[1]}x{self.size[0]}; at most {MOST_PIXELS:,} pixels are read"
            )
        expected = self.size[0] * self.size[1] * np.dtype(self.dtype).itemsize
        data = self.compressed.read_bytes()
        # A longer file than its content is none of ours.
        content = _inflated(data, expected + 1) if len(data) < expected + _FRAMING else data
        if not content and expected:
            raise OSError(errno.EIO, "damaged: it is not LZFSE")
        if len(content) != expected:
            said = f"not a map of {self.size[1]}x{self.size[0]} (width x height), which has {expected} bytes"
            raise OSError(errno.EIO, said)
        buffer = io.BytesIO()
        np.save(buffer, np.frombuffer(content, self.dtype).reshape(self.size))
        return buffer.getvalue()

    def __str__(self) -> str:
        return str(self.compressed)


def _inflated(data: bytes, most: int) -> bytes:
    """The first bytes that LZFSE data become, at most `most` of them; none if they are not LZFSE."""
    import lzfse

    try:
        # `lzfse.decompress` doubles its buffer until damaged data fit, which they may never do. The function below it has a limit.
        decode = ctypes.CDLL(lzfse.__file__).lzfse_decode_buffer
    except (AttributeError, OSError):  # a build that hides the function
        try:
            return bytes(lzfse.decompress(data)[:most]) if data.endswith(_END) else b""
        except lzfse.error:
            return b""
    decode.restype, size, place = ctypes.c_size_t, ctypes.c_size_t, ctypes.c_void_p
    decode.argtypes = [place, size, ctypes.c_char_p, size, place]
    buffer = ctypes.create_string_buffer(most)
    length = decode(buffer, most, data, len(data), None)
    return ctypes.string_at(buffer, length)


def can_inflate() -> bool:
    """Whether lzfse is installed (`pip install -e '.[phone]'`)."""
    return find_spec("lzfse") is not None
