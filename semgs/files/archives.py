"""Zip archives read in place: members are located once, and then read without listing the archive again.

A `Member` is plain data, so scenes made of members can be sent to worker processes. Uncompressed members are read as fast as files;
compressed (deflated) ones are inflated.
"""

from __future__ import annotations

import errno
import io
import posixpath
import struct
import zipfile
import zlib
from collections import Counter
from dataclasses import dataclass
from functools import cached_property, lru_cache
from pathlib import Path, PurePosixPath

from semgs.files.errors import InputError
from semgs.files.text import composed

MOST_BYTES = 1 << 28
"""Largest inflated member that is read [bytes]: 256 MiB, four times the largest photo."""

MOST_LISTED = 1 << 24
"""Longest list of members that is read [bytes]: 64 MiB, half a million members."""

LONGEST_NAME = 4000
"""Longest name of a member, with its folders [letters]; file systems refuse longer ones, and Python reads no longer number."""

METHODS = (zipfile.ZIP_STORED, zipfile.ZIP_DEFLATED)
"""How members may be compressed. Of other methods, a member of some kilobytes may need hundreds of megabytes to be read."""

_OTHER_METHODS = {
    9: "Deflate64, as Windows Explorer writes for large files", 12: "bzip2", 14: "LZMA", 93: "Zstandard", 95: "XZ", 98: "PPMd",
}  # fmt: skip
_ENCRYPTED = 0x1
_HEADER = struct.Struct("<4s22xHH")
"""A local file header: signature, then the lengths of the name and the extra field that follow it."""


class LongReadError(ValueError):
    """A file said that a part of it is longer than may be read at once."""


class BoundedFile(io.BufferedReader):
    """A file of which only so much can be read at once. A zip itself says how long the list of its members is, and `zipfile` reads all of it.

    Args:
        path: the file.
        most: bytes of one call.
    """

    def __init__(self, path: Path, most: int) -> None:
        super().__init__(path.open("rb", buffering=0))
        self._most = most

    def read(self, size: int | None = -1, /) -> bytes:
        """The next `size` bytes, by default the rest.

        Raises:
            LongReadError: these are too many.
        """
        if size is None or size < 0:
            size = self._most + 1
        elif size > self._most:
            raise LongReadError(f"a part of {size:,} bytes")
        data = super().read(size)
        if len(data) > self._most:
            raise LongReadError(f"more than {self._most:,} bytes")
        return data


@dataclass(frozen=True, slots=True)
class Member:
    """A file inside a zip archive.

    Attributes:
        archive: the zip file.
        inside: its path in the archive, with slashes ("images/000.jpg").
        header: offset of its local header [bytes].
        length: stored size [bytes].
        size: size of the content [bytes].
        checksum: CRC-32 of the content.
        deflated: whether it is compressed.
    """

    archive: Path
    inside: str
    header: int
    length: int
    size: int
    checksum: int
    deflated: bool = False

    @property
    def name(self) -> str:
        """The name without folders."""
        return PurePosixPath(self.inside).name

    @property
    def suffix(self) -> str:
        """The ending of the name."""
        return PurePosixPath(self.inside).suffix

    def is_file(self) -> bool:
        """Whether the archive still exists; the member existed when the archive was listed."""
        return self.archive.is_file()

    def read_bytes(self) -> bytes:
        """The content.

        Raises:
            OSError: the archive cannot be read, has changed or is damaged here, or the content is larger than `MOST_BYTES`.
        """
        if self.size > MOST_BYTES:
            raise OSError(errno.EFBIG, f"{self.size:,} bytes; at most {MOST_BYTES:,} are read")
        with self.archive.open("rb") as file:
            file.seek(self.header)
            start = file.read(_HEADER.size)
            if len(start) == _HEADER.size and start.startswith(b"PK\3\4"):
                _, name, extra = _HEADER.unpack(start)
                file.seek(name + extra, 1)
                data = file.read(self.length)
            else:
                data = b""
        try:
            # Never inflate more than the archive lists.
            content = zlib.decompressobj(-zlib.MAX_WBITS).decompress(data, self.size + 1) if self.deflated else data
        except zlib.error:
            content = b""
        if len(data) != self.length or len(content) != self.size or zlib.crc32(content) != self.checksum:
            raise OSError(
                errno.EIO, "its bytes differ from what the archive lists: damaged, or changed since it was opened"
            )
        return content

    def __str__(self) -> str:
        return f"{self.archive}/{self.inside}"


@dataclass(frozen=True)
class Archive:
    """The members of a zip archive by their names in it.

    Attributes:
        path: the zip file.
        members: its files.
    """

    path: Path
    members: dict[str, Member]

    def beside(self, member: Member, name: str) -> Member | None:
        """The file at a path relative to a member's folder, perhaps with another form of letters such as é (NFC, NFD); None if there is none, or several such."""
        place = posixpath.normpath(posixpath.join(posixpath.dirname(member.inside), name))
        found = self.members.get(place)
        return self._by_form.get(composed(place)) if found is None else found

    @cached_property
    def _by_form(self) -> dict[str, Member | None]:
        """The members by their names in Unicode's form NFC, None where several have it."""
        forms: dict[str, Member | None] = {}
        for name, member in self.members.items():
            form = composed(name)
            forms[form] = None if form in forms else member
        return forms


def members(archive: Path) -> dict[str, Member]:
    """The files of a zip archive by their names in it, with slashes, also where a program on Windows wrote backslashes.

    Raises:
        InputError: it is not a zip archive or is damaged, its list is longer than `MOST_LISTED`, two members have the same name, or a member has none or a very long one, is encrypted, compressed by
            another method than deflate, or longer than the archive.
    """
    # A folder of archives is looked at by every reader, and a long list takes seconds.
    try:
        status = archive.stat()
    except OSError as error:
        raise InputError(archive, "a zip archive", f"one that cannot be read: {error}") from error
    return dict(_members(archive, status.st_mtime_ns, status.st_size))


@lru_cache(maxsize=4)
def _members(archive: Path, _changed: int, _size: int) -> dict[str, Member]:
    """As `members`, for an archive that was changed at a time [ns] and has a size."""
    try:
        with BoundedFile(archive, MOST_LISTED) as file, zipfile.ZipFile(file) as opened:
            entries = [(one.filename.replace("\\", "/"), one) for one in opened.infolist()]
            listed = [(name, one) for name, one in entries if not name.endswith("/")]
            end = archive.stat().st_size
    except (zipfile.BadZipFile, OSError, ValueError, NotImplementedError) as error:
        raise InputError(archive, "a zip archive", f"one that cannot be read: {error}") from error
    for name, one in listed:
        if not name:
            raise InputError(archive, "members with names", "one without")
        if len(name) > LONGEST_NAME:
            raise InputError(archive, f"names of at most {LONGEST_NAME:,} letters", f"one of {len(name):,}")
        if one.flag_bits & _ENCRYPTED:
            raise InputError(
                archive, "members without a password", "one with a password", name, "unpack the zip and give the folder"
            )
        if one.compress_type not in METHODS:
            fault = f"one compressed by {method_of(one)}"
            advice = "unpack the zip and give the folder"
            raise InputError(archive, "members that are stored or deflated", fault, name, advice)
        if one.header_offset + one.compress_size > end:
            raise InputError(archive, "members inside it", f"one of {one.compress_size:,} bytes", name)
    found = {
        name: Member(
            archive,
            name,
            one.header_offset,
            one.compress_size,
            one.file_size,
            one.CRC,
            one.compress_type == zipfile.ZIP_DEFLATED,
        )
        for name, one in listed
    }
    if len(found) < len(listed):
        (name, count), *_ = Counter(name for name, _ in listed).most_common(1)
        raise InputError(archive, "one member of each name", f"{count}", name)
    return found


def method_of(member: zipfile.ZipInfo) -> str:
    """What compressed a member, for errors; its number if it has no common name."""
    return _OTHER_METHODS.get(member.compress_type, f"method {member.compress_type}")
