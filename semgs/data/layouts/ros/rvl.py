"""Depth compressed by RVL, as ROS's compressed_depth_image_transport writes it.

A. D. Wilson, "Fast lossless depth image compression", ISS 2017. Runs of pixels: how many are 0, how many are not, then for each of these the difference to the
one before it, with the sign in the lowest bit. Numbers are groups of three bits, the lowest first, each behind a bit that says whether another
follows; eight such nibbles are in a little-endian word of 32 bits, the first in its highest bits.
"""

from __future__ import annotations

import struct

import numpy as np
from jaxtyping import UInt16

from semgs.files.images.pictures import MOST_PIXELS

_SIZE = struct.Struct("<ii")
"""Columns and rows, before the numbers."""
MOST_BYTES_PER_PIXEL, SLACK = 4, 64
"""Most bytes that a map may take: a difference of 17 bits takes three, and a run of one pixel half a byte more."""

MOST_NIBBLES = 10
"""Of one number: 30 bits, more than the length of a run or a difference needs."""


def decode_rvl(data: bytes) -> UInt16[np.ndarray, "h w"]:
    """The counts of a depth map.

    Args:
        data: columns, rows, and the numbers.

    Raises:
        ValueError: it is damaged or truncated, or larger than `MOST_PIXELS`.
    """
    if len(data) < _SIZE.size:
        raise ValueError("RVL depth without its size")
    columns, rows = _SIZE.unpack_from(data)
    if min(columns, rows) < 1 or columns * rows > MOST_PIXELS:
        raise ValueError(f"RVL depth of {columns}x{rows} pixels; expected 1 to {MOST_PIXELS:,}")
    if len(data) > MOST_BYTES_PER_PIXEL * columns * rows + SLACK:
        raise ValueError(f"RVL depth of {len(data):,} bytes for {columns}x{rows} pixels")
    numbers, total = _numbers(data[_SIZE.size :]), columns * rows
    listed, lengths, heads = numbers.tolist(), list[int](), list[int]()
    place = index = 0
    while place < total:
        if index + 2 > len(listed):
            raise ValueError("RVL depth that ends early")
        heads += (index, index + 1)
        lengths += listed[index : index + 2]
        place += lengths[-2] + lengths[-1]
        index += 2 + lengths[-1]
    if place > total or index > len(listed):
        raise ValueError("RVL depth with another number of pixels than its size says")
    steps = np.delete(numbers[:index], heads)
    known = np.repeat(np.tile([False, True], len(lengths) // 2), lengths)
    counts = np.zeros(total, np.int64)
    counts[known] = np.cumsum((steps >> 1) ^ -(steps & 1))
    if counts.min() < 0 or counts.max() > np.iinfo(np.uint16).max:
        raise ValueError("RVL depth with counts of more than 16 bits")
    return counts.astype(np.uint16).reshape(rows, columns)


def _numbers(data: bytes) -> np.ndarray:
    """The numbers of a stream, int64; those of the zeros that fill the last word are 0."""
    words = np.frombuffer(data, "<u4", len(data) // 4)
    nibbles = ((words[:, None] >> np.arange(28, -1, -4, dtype=np.uint32)) & 15).ravel().astype(np.int64)
    ends = np.flatnonzero(nibbles < 8)
    if not len(ends):
        return np.zeros(0, np.int64)
    starts = np.concatenate(([0], ends[:-1] + 1))
    if (ends - starts).max() >= MOST_NIBBLES:
        raise ValueError("RVL depth with a number that is too large")
    nibbles = nibbles[: ends[-1] + 1]
    places = np.arange(len(nibbles)) - np.repeat(starts, ends - starts + 1)
    return np.add.reduceat((nibbles & 7) << 3 * places, starts)
