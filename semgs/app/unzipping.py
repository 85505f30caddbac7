"""Unpacks a zip whose content is not trusted: first its list is checked, then members are copied in pieces."""

from __future__ import annotations

import stat
import zipfile
from collections.abc import Sequence
from itertools import pairwise
from pathlib import Path, PurePosixPath

from semgs.app.limits import MIB, Limits
from semgs.files.archives import METHODS, BoundedFile, LongReadError, method_of
from semgs.files.atomic import new_file

PIECE = MIB
"""So much of a member is in memory [bytes]."""

LISTED_BYTES = 512
"""Longest entry of the list, on average, if it has as many files as are accepted [bytes]. An entry with a path of 100 letters has about 180."""

LONGEST_NAME, LONGEST_PATH, DEEPEST = 240, 1024, 32
"""Longest name of a file or folder, and longest path in the zip [bytes of UTF-8]; most folders inside one another. Disks allow names of 255
bytes; 15 are for the end of a temporary name."""

HEADER = 30
"""Bytes of a member's own header, before its name."""

ENCRYPTED = 0x1


class UnfitZipError(Exception):
    """A zip is not unpacked. Its text continues a sentence that begins with the name of the zip."""


def unpack_zip(path: Path, folder: Path, limits: Limits) -> None:
    """Unpack a zip into an existing, empty folder. A member that fails leaves no file.

    Raises:
        UnfitZipError: it is too large, or has members that an honest zip does not have.
        zipfile.BadZipFile, zlib.error, EOFError, ValueError, ...: it is damaged.
        OSError: a file cannot be written.
    """
    most_listed = max(LISTED_BYTES * limits.members, 2 * PIECE)
    with BoundedFile(path, most_listed) as file:
        try:
            archive = zipfile.ZipFile(file)
        except LongReadError as error:
            raise UnfitZipError(f"contains too many files; at most {limits.members:,} are accepted.") from error
        with archive:
            members = [one for one in archive.infolist() if not _name(one).endswith("/")]
            check_members(members, archive.start_dir, limits)
            left = limits.unpacked_bytes
            for member in members:
                target = folder.joinpath(*_path(member).parts)
                if _is_clutter(target):
                    continue
                target.parent.mkdir(parents=True, exist_ok=True)
                left -= _copy_member(archive, member, target, left)


def _copy_member(archive: zipfile.ZipFile, member: zipfile.ZipInfo, target: Path, most: int) -> int:
    """Write a member to a file. Its checksum is checked where it ends. Returns its bytes.

    Raises:
        UnfitZipError: it has more or less bytes than the list says, or more than `most`.
    """
    length = 0
    with archive.open(member) as source, new_file(target) as file:
        while piece := source.read(PIECE):
            length += len(piece)
            if length > most:
                break
            file.write(piece)
        if length != member.file_size or length > most:
            raise UnfitZipError("contains more than it says. It may be damaged.")
    return length


def check_members(members: Sequence[zipfile.ZipInfo], end: int, limits: Limits) -> None:
    """Check the files that a zip lists.

    Args:
        members: those of its list that are no folders.
        end: where the list begins, and so all members have ended [bytes].
        limits: of the app.

    Raises:
        UnfitZipError: it has too many or too large members, or one that an honest zip does not have.
    """
    if not members:
        raise UnfitZipError("is an empty zip.")
    if len(members) > limits.members:
        raise UnfitZipError(f"contains {len(members):,} files; at most {limits.members:,} are accepted.")
    unpacked = sum(one.file_size for one in members)
    if unpacked > limits.unpacked_bytes:
        raise UnfitZipError(
            f"would unpack to {unpacked // MIB:,} MB; at most {limits.unpacked_bytes // MIB:,} MB are accepted."
        )
    for one in members:
        _check_member(one)
    _check_names([_path(one) for one in members], limits)
    places = sorted((one.header_offset, HEADER + len(one.orig_filename) + one.compress_size) for one in members)
    if any(start + length > after for (start, length), (after, _) in pairwise([*places, (end, 0)])):
        raise UnfitZipError("contains files that overlap. It was not unpacked.")


def _check_member(member: zipfile.ZipInfo) -> None:
    """Check one member: its path, its kind, and how it is compressed."""
    path = _path(member)
    if not path.parts:
        raise UnfitZipError("contains a file without a name. Make the zip again.")
    outside = path.is_absolute() or ".." in path.parts or ":" in path.parts[0]
    if outside or "\0" in member.orig_filename:
        raise UnfitZipError("contains a path that leads outside of it. It was not unpacked.")
    if any(_bytes_of(name) > LONGEST_NAME for name in path.parts) or _bytes_of(member.filename) > LONGEST_PATH:
        raise UnfitZipError("contains a name that is too long. Use shorter names of files and folders.")
    if len(path.parts) > DEEPEST:
        raise UnfitZipError(f"contains more than {DEEPEST} folders inside one another.")
    kind = stat.S_IFMT(member.external_attr >> 16)
    if kind == stat.S_IFLNK:
        raise UnfitZipError("contains a link. Pack the files themselves.")
    if kind not in (0, stat.S_IFREG):
        raise UnfitZipError("contains a device or a pipe. Make a zip of files alone.")
    if member.flag_bits & ENCRYPTED:
        raise UnfitZipError("has a password. Make a zip without one.")
    if member.compress_type not in METHODS:
        raise UnfitZipError(
            f"is compressed by {method_of(member)}, which is not read. Make the zip with the method Deflate."
        )


def _check_names(paths: Sequence[PurePosixPath], limits: Limits) -> None:
    """Check that the paths of files can exist beside one another."""
    if len(set(paths)) < len(paths):
        raise UnfitZipError("contains two files of the same name. Make the zip again.")
    folders = {folder for path in paths for folder in path.parents}
    if folders & set(paths):
        raise UnfitZipError("contains a file and a folder of the same name. Make the zip again.")
    if len(folders) > limits.members + 1:
        raise UnfitZipError(f"contains {len(folders) - 1:,} folders; at most {limits.members:,} are accepted.")


def _name(member: zipfile.ZipInfo) -> str:
    """The name of a member with slashes. Some programs on Windows write backslashes; all checks see them as slashes, as the folders are made so."""
    return member.filename.replace("\\", "/")


def _path(member: zipfile.ZipInfo) -> PurePosixPath:
    """Where a member is in the folder."""
    return PurePosixPath(_name(member))


def _bytes_of(name: str) -> int:
    """Length of a name on disk [bytes]."""
    return len(name.encode(errors="surrogatepass"))


def _is_clutter(path: Path) -> bool:
    """Whether a member is what systems add to zips."""
    return "__MACOSX" in path.parts or path.name in (".DS_Store", "Thumbs.db") or path.name.startswith("._")
