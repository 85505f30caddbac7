"""Images in ROS messages as files: JPEG and PNG unchanged, raw pixels as PNG, depth in metres as NumPy arrays.

https://github.com/ros2/common_interfaces (sensor_msgs), REP 118 (depth: 16 bits are millimetres, floats metres),
https://github.com/ros-perception/image_transport_plugins (compressedDepth: a header of 12 bytes, then a PNG, or RVL).

ROS's compressed_depth_image_transport may compress depth by RVL: A. D. Wilson, "Fast lossless depth image compression", ISS 2017. Runs of pixels: how many are 0, how many are not, then for each of these the difference to the
one before it, with the sign in the lowest bit. Numbers are groups of three bits, the lowest first, each behind a bit that says whether another
follows; eight such nibbles are in a little-endian word of 32 bits, the first in its highest bits.
"""

from __future__ import annotations

import io
import struct
from typing import Any

import cv2
import numpy as np
from jaxtyping import UInt16

from semgs.files.images.pictures import MOST_PIXELS, decode_png

COLOURS = {
    "rgb8": (3, cv2.COLOR_RGB2BGR), "bgr8": (3, None), "8UC3": (3, None),
    "rgba8": (4, cv2.COLOR_RGBA2BGR), "bgra8": (4, cv2.COLOR_BGRA2BGR), "8UC4": (4, cv2.COLOR_BGRA2BGR),
    "mono8": (1, cv2.COLOR_GRAY2BGR), "8UC1": (1, cv2.COLOR_GRAY2BGR),
    "bayer_rggb8": (1, cv2.COLOR_BayerBG2BGR), "bayer_bggr8": (1, cv2.COLOR_BayerRG2BGR),
    "bayer_gbrg8": (1, cv2.COLOR_BayerGR2BGR), "bayer_grbg8": (1, cv2.COLOR_BayerGB2BGR),
    "yuv422": (2, cv2.COLOR_YUV2BGR_UYVY), "uyvy": (2, cv2.COLOR_YUV2BGR_UYVY),
    "yuv422_yuy2": (2, cv2.COLOR_YUV2BGR_YUY2), "yuyv": (2, cv2.COLOR_YUV2BGR_YUY2),
}  # fmt: skip
"""Image encodings: bytes per pixel, and OpenCV's conversion to BGR. OpenCV names Bayer patterns by their second row."""

WIDE = {"rgb16": "rgb8", "bgr16": "bgr8", "rgba16": "rgba8", "bgra16": "bgra8", "16UC3": "8UC3", "16UC4": "8UC4"}
"""Image encodings of 16 bits, and those of 8 bits that they become."""

PLANES = {
    "nv12": cv2.COLOR_YUV2BGR_NV12,
    "nv21": cv2.COLOR_YUV2BGR_NV21,
    "i420": cv2.COLOR_YUV2BGR_I420,
    "yv12": cv2.COLOR_YUV2BGR_YV12,
}
"""Image encodings whose brightness comes first, and then, at half the size, their colours."""

DEPTHS = {"16UC1": 2, "mono16": 2, "32FC1": 4}
"""Depth encodings: bytes per pixel."""

GREYS = ("mono8", "8UC1")
COMPRESSED_DEPTH, RVL = "compressedDepth", "rvl"
_DEPTH_HEADER = struct.Struct("<iff")
"""Header of compressedDepth: kind of compression, and two parameters of inverse depth."""

_SIZE = struct.Struct("<ii")
"""Columns and rows, before the numbers."""
MOST_BYTES_PER_PIXEL, SLACK = 4, 64
"""Most bytes that a map may take: a difference of 17 bits takes three, and a run of one pixel half a byte more."""

MOST_NIBBLES = 10
"""Of one number: 30 bits, more than the length of a run or a difference needs."""


def encoding_of(message: Any) -> str:
    """The encoding of the pixels of an Image or CompressedImage, before compression; "" if unknown."""
    if hasattr(message, "encoding"):
        return str(message.encoding)
    return str(message.format).partition(";")[0].strip() if ";" in message.format else ""


def is_depth(message: Any) -> bool:
    """Whether a message is a depth map."""
    return encoding_of(message) in DEPTHS or COMPRESSED_DEPTH in getattr(message, "format", "")


def depth_fault(message: Any) -> str | None:
    """Why a depth map cannot be read, None if it can."""
    try:
        data = as_file(message)
    except ValueError as error:
        return str(error)
    if hasattr(message, "encoding") or COMPRESSED_DEPTH in message.format:
        return None
    if data[:2] == b"\xff\xd8":
        return "it is compressed as JPEG, which keeps 8 bits and changes them"
    counts = decode_png(data)
    return None if counts is not None and counts.dtype == np.uint16 and counts.ndim == 2 else "it is no 16-bit PNG"


def ending_of(message: Any) -> str:
    """The ending of a message's file: ".jpg", ".png", or ".npy" for depth in metres."""
    if is_depth(message):
        return ".npy" if encoding_of(message) == "32FC1" else ".png"
    return ".jpg" if bytes(message.data[:2]) == b"\xff\xd8" and not hasattr(message, "encoding") else ".png"


def as_file(message: Any) -> bytes:
    """The file of a message.

    Raises:
        ValueError: the encoding is not supported, or there are too few pixels.
    """
    if not hasattr(message, "encoding"):
        data = bytes(message.data)
        return _compressed_depth(data, message.format) if COMPRESSED_DEPTH in message.format else data
    pixels = pixels_of(message)
    return _png(pixels, 0) if pixels.ndim == 3 else _depth_file(pixels)


def pixels_of(message: Any) -> np.ndarray:
    """The pixels of an Image: BGR uint8 [h w 3], or depth [h w], uint16 in millimetres or float32 in metres.

    Raises:
        ValueError: the encoding is not supported, or there are too few pixels.
    """
    if message.encoding in DEPTHS:
        counts = _pixels(message, DEPTHS[message.encoding])
        order = ">" if message.is_bigendian else "<"
        return counts.view(f"{order}u2" if counts.shape[-1] == 2 else f"{order}f4")[..., 0]
    if message.encoding in PLANES:
        height, width = int(message.height), int(message.width)
        planes = _rows(message, 3 * height // 2, width)
        return np.asarray(cv2.cvtColor(planes, PLANES[message.encoding]))
    encoding = WIDE.get(message.encoding, message.encoding)
    if encoding not in COLOURS:
        known = ", ".join((*COLOURS, *WIDE, *PLANES, *DEPTHS))
        raise ValueError(f"pixels encoded as {message.encoding!r}; expected one of {known}, or a CompressedImage")
    channels, code = COLOURS[encoding]
    if encoding != message.encoding:
        counts = _pixels(message, 2 * channels).view(">u2" if message.is_bigendian else "<u2")
        pixels = ((counts.astype(np.uint32) + 128) // 257).astype(np.uint8)
    else:
        pixels = _pixels(message, channels)
    return pixels if code is None else np.asarray(cv2.cvtColor(pixels, code))


def _pixels(message: Any, size: int) -> np.ndarray:
    """The bytes of an Image [h w size], without row padding."""
    height, width = int(message.height), int(message.width)
    return _rows(message, height, width * size).reshape(height, width, size)


def _rows(message: Any, rows: int, length: int) -> np.ndarray:
    """The bytes of an Image [rows length], without row padding."""
    height, width, step = int(message.height), int(message.width), int(message.step)
    data = np.asarray(message.data, dtype=np.uint8)
    if step < length:
        raise ValueError(f"step is {step}; {message.encoding} of {width} pixels needs at least {length}")
    if data.size < rows * step or min(height, width) < 1:
        raise ValueError(
            f"{data.size} bytes of {width}x{height} pixels in rows of {step} bytes; expected {rows * length}"
        )
    return np.ascontiguousarray(data[: rows * step].reshape(rows, step)[:, :length])


def _compressed_depth(data: bytes, form: str) -> bytes:
    """The file of a compressedDepth message."""
    if len(data) < _DEPTH_HEADER.size:
        raise ValueError(f"{len(data)} bytes; expected a header of {_DEPTH_HEADER.size} and a PNG or RVL")
    _, a, b = _DEPTH_HEADER.unpack_from(data)
    inside = data[_DEPTH_HEADER.size :]
    packed = inside[:4] == b"\x89PNG"
    counts: np.ndarray | None
    if not packed and RVL in form.lower():
        counts = decode_rvl(inside)
    else:
        counts = decode_png(inside)
        if counts is None or counts.dtype != np.uint16 or counts.ndim != 2:
            raise ValueError("compressed depth that is neither a 16-bit PNG nor RVL")
    if form.partition(";")[0].strip() != "32FC1":
        return inside if packed else _depth_file(counts)
    with np.errstate(divide="ignore", invalid="ignore"):
        depths = np.where(counts > 0, a / (counts.astype(np.float32) - b), 0)
    return _depth_file(depths.astype(np.float32))


def _depth_file(depths: np.ndarray) -> bytes:
    """Counts as PNG, metres as a NumPy array."""
    if depths.dtype.kind == "u":
        return _png(np.ascontiguousarray(depths.astype(np.uint16)), 1)
    buffer = io.BytesIO()
    np.save(buffer, depths.astype(np.float32))
    return buffer.getvalue()


def _png(pixels: np.ndarray, compression: int) -> bytes:
    """A PNG of BGR or one channel; without compression, this takes a few milliseconds."""
    return cv2.imencode(".png", pixels, [cv2.IMWRITE_PNG_COMPRESSION, compression])[1].tobytes()


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
