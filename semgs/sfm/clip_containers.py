"""Which files are clips: videos that contain their frames.

FFmpeg, which OpenCV decodes with, goes by the content of a file and not by its name. Some formats are lists of other files and addresses, which it would
open: playlists, scripts, descriptions of sessions. So a clip has to begin like a video, and FFmpeg may open nothing else.
"""

from __future__ import annotations

import os
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import BinaryIO

from semgs.files.errors import InputError, readable

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
