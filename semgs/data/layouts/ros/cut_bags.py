"""MCAP recordings that end early, as their recorder was killed: everything before the end is read, as `mcap recover` keeps it.

https://mcap.dev/spec: after eight bytes of magic come records, each a byte that says its kind, eight bytes with its length, and its content; the last one is the
footer, then the magic again.
"""

from __future__ import annotations

import io
import re
import struct
from pathlib import Path
from typing import BinaryIO

from semgs.files.bags import METADATA
from semgs.files.paths import not_hidden

MAGIC = b"\x89MCAP0\r\n"
FOOTER = b"\x02" + struct.pack("<QQQI", 20, 0, 0, 0) + MAGIC
"""A footer without a summary, so that readers look through all records."""

DATA_END, FOOTER_KIND, CHUNK_KIND = 0x0F, 0x02, 0x06
_KIND_AND_LENGTH = struct.Struct("<BQ")
_CHUNK = struct.Struct("<BQQQQIIQ")
"""Kind and length of a chunk, first and last time, size, checksum, letters of the name of its compression (0: none), and length of its records."""
MOST_CHUNK = 1 << 28
"""At most so much of a chunk that ends early is read [bytes]."""
MOST_RECORDS = 10_000_000
"""More records of a recording that ends early are not read."""
_UNSTATED = re.compile(rb"^\s*storage_identifier:\s*(''|\"\")?\s*$", re.MULTILINE)


class CutRecording(type(Path())):  # type: ignore[misc]
    """The path of a recording that ends early; opened, it ends with its last complete record."""

    def open(self, *mode: str, **options: object) -> io.BufferedReader:  # type: ignore[override]
        """The file, to be read as bytes."""
        return io.BufferedReader(_Completed(Path(self)))


class _Completed(io.RawIOBase):
    """A file up to its last complete record, then those in a chunk that ends early, and a footer."""

    def __init__(self, path: Path) -> None:
        self._file, self._at = path.open("rb"), 0
        self._end = _end_of_records(self._file, len(MAGIC))
        self._rest = _records_of_chunk(self._file, self._end) + FOOTER

    def readable(self) -> bool:
        """Yes."""
        return True

    def seekable(self) -> bool:
        """Yes."""
        return True

    def seek(self, offset: int, whence: int = io.SEEK_SET) -> int:
        """As of any file."""
        self._at = offset + {io.SEEK_SET: 0, io.SEEK_CUR: self._at, io.SEEK_END: self._end + len(self._rest)}[whence]
        return self._at

    def readinto(self, buffer: memoryview) -> int:  # type: ignore[override]
        """As of any file."""
        self._file.seek(self._at)
        data = self._file.read(min(len(buffer), max(0, self._end - self._at)))
        data = data or self._rest[max(0, self._at - self._end) :][: len(buffer)]
        buffer[: len(data)] = data
        self._at += len(data)
        return len(data)

    def close(self) -> None:
        """Close the file, too."""
        self._file.close()
        super().close()


def _end_of_records(file: BinaryIO, at: int) -> int:
    """Where the complete records of a file end, which begin at a place."""
    length = file.seek(0, io.SEEK_END)
    for _ in range(MOST_RECORDS):
        if at + _KIND_AND_LENGTH.size > length:
            break
        file.seek(at)
        kind, size = _KIND_AND_LENGTH.unpack(file.read(_KIND_AND_LENGTH.size))
        if kind in (DATA_END, FOOTER_KIND) or size > length - at - _KIND_AND_LENGTH.size:
            break
        at += _KIND_AND_LENGTH.size + size
    return at


def _records_of_chunk(file: BinaryIO, at: int) -> bytes:
    """The complete records in a chunk that ends early; none if it is compressed."""
    file.seek(at)
    start = file.read(_CHUNK.size)
    if len(start) < _CHUNK.size or start[0] != CHUNK_KIND or _CHUNK.unpack(start)[-2]:
        return b""
    inner = io.BytesIO(file.read(MOST_CHUNK))
    return inner.getvalue()[: _end_of_records(inner, 0)]


def recordings_of(path: Path) -> list[Path]:
    """What to open of a bag: it, or, if one of its recordings ends early or the list of its topics does not say what they are, its recordings.

    Args:
        path: of the bag, a file or a folder.
    """
    files = (
        not_hidden(file for ending in ("mcap", "db3") for file in path.glob(f"*.{ending}")) if path.is_dir() else [path]
    )
    made = [CutRecording(file) if _ends_early(file) else file for file in files]
    said = (path / METADATA).read_bytes() if (path / METADATA).is_file() else b""
    salvaged = any(isinstance(one, CutRecording) for one in made) or _UNSTATED.search(said) is not None
    return made if files and (salvaged or not path.is_dir()) else [path]


def _ends_early(file: Path) -> bool:
    """Whether a file is a recording without its end."""
    with file.open("rb") as opened:
        if opened.read(len(MAGIC)) != MAGIC:
            return False
        opened.seek(max(0, opened.seek(0, io.SEEK_END) - len(MAGIC)))
        return opened.read() != MAGIC
