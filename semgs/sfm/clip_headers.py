"""The sizes of frames that a clip's header announces, and whether they are mirrored, read without decoding anything, and a limit for frames that are larger.

Opening a clip already decodes frames, so its size has to be known before. The containers are MP4 and MOV (ISO/IEC 14496-12), Matroska and WebM
(RFC 9559), and AVI.

Clips are videos that contain their frames. FFmpeg, which OpenCV decodes with, goes by the content of a file and not by its name. Some formats are lists of other files and addresses, which it would
open: playlists, scripts, descriptions of sessions. So a clip has to begin like a video, and FFmpeg may open nothing else.
"""

from __future__ import annotations

import ctypes
import os
import struct
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import BinaryIO

from semgs.files.errors import InputError, readable
from semgs.files.images.pictures import MOST_PIXELS

MOST_PARTS = 20_000
"""So many boxes, elements or chunks of a clip are looked at; they are some hundred, and one a second for the frames of recordings."""

DEEPEST = 8
"""So deep are parts inside one another that are looked at; sample descriptions are at 6."""

MOST_READ = 1 << 16
"""Longest part that is read [bytes]."""

LEAST_ALLOCATION = 1 << 26
"""FFmpeg may always allocate this much at once [bytes], for packets and tables."""

_BOXES = (b"moov", b"trak", b"mdia", b"minf", b"stbl")
_LISTS = (b"hdrl", b"strl")
_SEGMENT, _TRACKS, _ENTRY, _VIDEO = 0x18538067, 0x1654AE6B, 0xAE, 0xE0
_PROJECTION, _YAW = 0x7670, 0x7673
_ELEMENTS = (_SEGMENT, _TRACKS, _ENTRY, _VIDEO, _PROJECTION)
_WIDTH, _HEIGHT = 0xB0, 0xBA
_HALF_TURNS = frozenset(struct.pack(form, yaw) for form in (">f", ">d") for yaw in (180, -180))
"""The yaws that mean mirrored frames; others are of panoramas."""

_MATRICES = {b"mvhd": (36, 48), b"tkhd": (40, 52)}
"""Where the matrix of a movie and of a track begins in their boxes of version 0 and 1."""
_EBML = b"\x1aE\xdf\xa3"

BOXES = (b"ftyp", b"moov", b"mdat", b"wide", b"free", b"skip", b"pnot")
"""What the first box of an MP4 or MOV may be, after its length in four bytes. ISO/IEC 14496-12, QuickTime File Format."""

EBML = b"\x1aE\xdf\xa3"
"""How MKV and WebM begin. RFC 8794."""

MOST_BOXES = 20_000
"""The description of an MP4 or MOV is looked for among so many boxes; it is seldom behind the fourth."""

VARIABLE = "OPENCV_FFMPEG_CAPTURE_OPTIONS"
"""OpenCV's environment variable with options of FFmpeg."""

OPTIONS = "protocol_whitelist;file|format_whitelist;mov,avi,matroska|enable_drefs;0"
"""Neither addresses, nor formats that are lists, nor frames of an MP4 or MOV in another file."""


def check_clip_size(path: Path, most: int = MOST_PIXELS) -> None:
    """Refuse a clip whose header announces frames of more than `most` pixels, before it is opened. Several tracks of frames count together.

    Raises:
        InputError: it does.
    """
    sizes = read_clip_sizes(path)
    if sum(height * width for height, width in sizes) > most:
        height, width = max(sizes, key=lambda size: size[0] * size[1])
        tracks = "" if len(sizes) == 1 else f" in one of {len(sizes)} tracks"
        raise InputError(path, f"frames of at most {most:,} pixels", f"{width}x{height}{tracks}")


def read_clip_sizes(path: Path) -> list[tuple[int, int]]:
    """(height, width) of the frames of each video track, as the container's header says [px]; empty if it says nothing."""
    with path.open("rb") as file:
        start = file.read(12)
        end = file.seek(0, 2)
        parts = _Parts(file)
        if start[:4] == _EBML:
            sides = [(kind, data) for kind, data in parts.matroska(0, end) if kind in (_WIDTH, _HEIGHT)]
            heights = [int.from_bytes(data) for kind, data in sides if kind == _HEIGHT]
            widths = [int.from_bytes(data) for kind, data in sides if kind == _WIDTH]
            return list(zip(heights, widths, strict=False))
        if start[:4] == b"RIFF" and start[8:12] == b"AVI ":
            chunks = parts.avi(12, end)
            return [size for (_, header), (_, picture) in _pairs(chunks) if (size := _avi_size(header, picture))]
        return [size for name, entries in parts.mp4(0, end) if name == b"stsd" for size in _mp4_sizes(entries)]


def is_mirrored(path: Path) -> bool:
    """Whether a clip's frames are to be shown mirrored, apart from rotations, as some phones record with the front camera.

    In MP4 and MOV, the product of the matrices of movie and track then has a negative determinant.

    Raises:
        InputError: they are in Matroska, where it depends on the version of FFmpeg what OpenCV does, or only in some of several video tracks.
    """
    with path.open("rb") as file:
        start = file.read(12)
        end = file.seek(0, 2)
        parts, found = _Parts(file), set[bool]()
        if start[:4] == _EBML:
            found = {False, *(data in _HALF_TURNS for kind, data in parts.matroska(0, end) if kind == _YAW)}
        elif start[:4] != b"RIFF":
            mirrors = {b"mvhd": False, b"tkhd": False}
            for name, data in parts.mp4(0, end):
                if name == b"stsd":
                    found.add(mirrors[b"mvhd"] != mirrors[b"tkhd"])
                else:
                    mirrors[name] = _mirrors(name, data)
    if len(found) > 1:
        advice = f"convert it first, which applies it: ffmpeg -i {path.name} converted.mp4"
        page = "it is mirrored by its header. Convert it to H.264 in MP4"
        raise InputError(path, "a clip that is not mirrored by its header", "one that is", advice=advice, page=page)
    return True in found


def limit_frames(pixels: int) -> None:
    """Let FFmpeg, in this process, decode no frame of more than three times so many pixels, whatever a header says, and convert none of more to RGB.

    It can allocate only as much at once as an RGB frame takes. Only where OpenCV uses FFmpeg as a shared library, as on Linux; elsewhere nothing happens.
    """
    try:
        lines = Path("/proc/self/maps").read_text(encoding="utf-8", errors="replace").splitlines()
    except OSError:
        return
    library = next((line.split(maxsplit=5)[-1] for line in lines if "opencv" in line and "libavutil" in line), None)
    if library is not None:
        allow = ctypes.CDLL(library).av_max_alloc
        allow.argtypes, allow.restype = [ctypes.c_size_t], None
        allow(max(LEAST_ALLOCATION, 3 * pixels + (1 << 20)))


class _Parts:
    """The parts of a container that lead to the sizes of frames; all other parts are skipped."""

    def __init__(self, file: BinaryIO) -> None:
        self._file, self._left = file, MOST_PARTS

    def _read(self, place: int, length: int) -> bytes:
        """Bytes at a place; fewer at the end of the file."""
        self._file.seek(place)
        return self._file.read(min(length, MOST_READ))

    def _counted(self, depth: int) -> bool:
        """Count a part. False if there were too many, or it is too deep."""
        self._left -= 1
        return self._left >= 0 and depth <= DEEPEST

    def mp4(self, place: int, end: int, parent: bytes = b"", depth: int = 1) -> Iterator[tuple[bytes, bytes]]:
        """The contents of all sample descriptions (`stsd`) of video tracks, and before them those of the headers with matrices."""
        kind = b""
        while place + 8 <= end and self._counted(depth):
            start = self._read(place, 16)
            length, name = int.from_bytes(start[:4]), start[4:8]
            header = 16 if length == 1 else 8
            length = int.from_bytes(start[8:16]) if length == 1 else length or end - place
            if length < header:
                return
            inside, after = place + header, min(place + length, end)
            if name in _BOXES:
                if kind in (b"", b"vide"):
                    yield from self.mp4(inside, after, name, depth + 1)
            elif name == b"hdlr" and parent == b"mdia":
                kind = self._read(inside + 8, 4)
            elif name == b"stsd" or name in _MATRICES:
                yield name, self._read(inside, after - inside)
            place += length

    def avi(self, place: int, end: int, depth: int = 1) -> Iterator[tuple[bytes, bytes]]:
        """Stream headers (`strh`) and formats (`strf`)."""
        while place + 8 <= end and self._counted(depth):
            start = self._read(place, 12)
            name, length = start[:4], int.from_bytes(start[4:8], "little")
            if name == b"LIST" and start[8:12] in _LISTS:
                yield from self.avi(place + 12, min(place + 8 + length, end), depth + 1)
            elif name in (b"strh", b"strf"):
                yield name, self._read(place + 8, min(length, end - place - 8))
            place += 8 + length + length % 2

    def matroska(self, place: int, end: int, depth: int = 1) -> Iterator[tuple[int, bytes]]:
        """The numbers of all video tracks: widths, heights and yaws."""
        while place < end and self._counted(depth):
            start = self._read(place, 12)
            name_length = 9 - start[0].bit_length()
            name, rest = int.from_bytes(start[:name_length]), start[name_length:]
            if name_length > 4 or not rest or not rest[0]:
                return
            size_length = 9 - rest[0].bit_length()
            marker = 1 << 7 * size_length
            length = int.from_bytes(rest[:size_length]) - marker
            inside = place + name_length + size_length
            after = end if length == marker - 1 else min(inside + length, end)  # all ones: of unknown length
            if name in _ELEMENTS:
                yield from self.matroska(inside, after, depth + 1)
            elif name in (_WIDTH, _HEIGHT, _YAW):
                yield name, self._read(inside, min(8, after - inside))
            place = after


def _mirrors(name: bytes, header: bytes) -> bool:
    """Whether the matrix of a movie or track mirrors; its numbers are a, b, u, c, d."""
    place = _MATRICES[name][header[:1] == b"\1"]
    if place + 20 > len(header):
        return False
    across, turn, _, other, down = struct.unpack_from(">5i", header, place)
    return bool(across * down < turn * other)


def _mp4_sizes(description: bytes) -> Iterator[tuple[int, int]]:
    """Sizes of the entries of a sample description: width and height are at byte 32 of each."""
    place = 8
    while place + 36 <= len(description):
        (length,) = struct.unpack_from(">I", description, place)
        width, height = struct.unpack_from(">2H", description, place + 32)
        yield height, width
        if length < 36:
            return
        place += length


def _pairs(chunks: Iterator[tuple[bytes, bytes]]) -> Iterator[tuple[tuple[bytes, bytes], tuple[bytes, bytes]]]:
    """Each stream header with the format behind it."""
    header = (b"", b"")
    for chunk in chunks:
        if chunk[0] == b"strh":
            header = chunk
        else:
            yield header, chunk


def _avi_size(header: bytes, picture: bytes) -> tuple[int, int] | None:
    """Size of the frames of a stream (BITMAPINFOHEADER); None if it is not of pictures."""
    if header[:4] != b"vids" or len(picture) < 12:
        return None
    width, height = struct.unpack_from("<2i", picture, 4)
    return abs(height), abs(width)


def check_container(path: Path) -> None:
    """Check that a file begins like MP4, MOV, AVI, MKV or WebM, and that an MP4 or MOV has the description of its frames, which recorders write last.

    Raises:
        InputError: it does not, or cannot be read.
    """
    with readable(path), path.open("rb") as file:
        start = file.read(12)
        described = start[4:8] not in BOXES or _has_description(file)
    if not described:
        found = "an incomplete one, cut off while it was recorded or copied"
        page = "it is incomplete: it was cut off while it was recorded or copied. Copy it again, or film anew"
        raise InputError(path, "a complete MP4 or MOV", found, advice="copy it again, or film anew", page=page)
    is_avi = start[:4] == b"RIFF" and start[8:] == b"AVI "
    if not is_avi and start[:4] != EBML and start[4:8] not in BOXES:
        found = "something else" if start else "an empty file"
        raise InputError(path, "a video in MP4, MOV, AVI, MKV or WebM", found, advice="convert it to H.264 in MP4")


def _has_description(file: BinaryIO) -> bool:
    """Whether an MP4 or MOV has its box `moov`, up to its end. A box of length 0 reaches to the end of the file, and one of length 1 has its length in 8 bytes."""
    place, end = 0, file.seek(0, os.SEEK_END)
    for _ in range(MOST_BOXES):
        file.seek(place)
        start = file.read(16)
        length = int.from_bytes(start[:4])
        length = int.from_bytes(start[8:]) if length == 1 else length or end - place
        place += length
        if length < 8 or place > end:
            return False
        if start[4:8] == b"moov":
            return True
    return False


@contextmanager
def only_this_file() -> Iterator[None]:
    """While OpenCV opens a clip, FFmpeg may open nothing but that."""
    before = os.environ.get(VARIABLE)
    os.environ[VARIABLE] = OPTIONS
    try:
        yield
    finally:
        if before is None:
            del os.environ[VARIABLE]
        else:
            os.environ[VARIABLE] = before
