"""Clips that tests write: MP4s, perhaps with the flag of a phone held upright, or pixels that are not square."""

from __future__ import annotations

import struct
from collections.abc import Sequence
from pathlib import Path

import cv2
import numpy as np

MATRIX_AT = 44
"""Where the matrix starts in a track's header, after the start of its name (ISO 14496-12, `tkhd` of version 0)."""


def write_clip(path: Path, frames: Sequence[np.ndarray], *, clockwise: bool = False, codec: str = "mp4v") -> Path:
    """Write frames in RGB as they are; `clockwise` tells players to turn them by 90 degrees."""
    height, width = frames[0].shape[:2]
    video = cv2.VideoWriter(str(path), cv2.VideoWriter.fourcc(*codec), 10, (width, height))
    for frame in frames:
        video.write(np.ascontiguousarray(frame[..., ::-1]))
    video.release()
    if clockwise:
        content = bytearray(path.read_bytes())
        # (x, y) is shown at (height - y, x). Numbers of the last column have 30 bits after the point, the others 16.
        matrix = struct.pack(">9i", 0, 1 << 16, 0, -1 << 16, 0, 0, height << 16, 0, 1 << 30)
        place = content.index(b"tkhd") + MATRIX_AT
        content[place : place + len(matrix)] = matrix
        path.write_bytes(content)
    return path


def show_as(path: Path, width: int, height: int) -> Path:
    """Let the header of an MP4 say that its frames, as they are stored, are shown with another size: their pixels are not square then."""
    content = bytearray(path.read_bytes())
    struct.pack_into(">2I", content, content.index(b"tkhd") + MATRIX_AT + 36, width << 16, height << 16)
    path.write_bytes(content)
    return path


def with_matrix(path: Path, across: int, down: int, across_from_y: int, down_from_y: int) -> Path:
    """Let the header of an MP4 say that (x, y) is shown at (across x + across_from_y y, down x + down_from_y y), up to a shift; numbers are -1, 0 or 1."""
    content = bytearray(path.read_bytes())
    numbers = [one << 16 for one in (across, down, 0, across_from_y, down_from_y)]
    struct.pack_into(">5i", content, content.index(b"tkhd") + MATRIX_AT, *numbers)
    path.write_bytes(content)
    return path
