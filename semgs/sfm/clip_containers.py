"""Which files are clips: videos that contain their frames.

FFmpeg, which OpenCV decodes with, goes by the content of a file and not by its name. Some formats are lists of other files and addresses, which it would
open: playlists, scripts, descriptions of sessions. So a clip has to begin like a video, and FFmpeg may open nothing else.
"""

from __future__ import annotations

import os
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from semgs.files.errors import InputError, readable

BOXES = (b"ftyp", b"moov", b"mdat", b"wide", b"free", b"skip", b"pnot")
"""What the first box of an MP4 or MOV may be, after its length in four bytes. ISO/IEC 14496-12, QuickTime File Format."""

EBML = b"\x1aE\xdf\xa3"
"""How MKV and WebM begin. RFC 8794."""

VARIABLE = "OPENCV_FFMPEG_CAPTURE_OPTIONS"
"""OpenCV's environment variable with options of FFmpeg."""

OPTIONS = "protocol_whitelist;file|format_whitelist;mov,avi,matroska|enable_drefs;0"
"""Neither addresses, nor formats that are lists, nor frames of an MP4 or MOV in another file."""


def check_container(path: Path) -> None:
    """Check that a file begins like MP4, MOV, AVI, MKV or WebM.

    Raises:
        InputError: it does not, or cannot be read.
    """
    with readable(path), path.open("rb") as file:
        start = file.read(12)
    is_avi = start[:4] == b"RIFF" and start[8:] == b"AVI "
    if not is_avi and start[:4] != EBML and start[4:8] not in BOXES:
        found = "something else" if start else "an empty file"
        raise InputError(path, "a video in MP4, MOV, AVI, MKV or WebM", found, advice="convert it to H.264 in MP4")


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
