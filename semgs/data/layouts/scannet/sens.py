"""`.sens`, ScanNet's recordings: where each frame's colour and depth lie, found by walking the file; each is read when it is asked for.

    version u32 = 4 | name u64 + bytes | colour K, colour extrinsic, depth K, depth extrinsic: 16 f32 each, row by row
    colour codec i32 | depth codec i32 | colour width, height, depth width, height: u32 | depth counts a metre f32 | frames u64
    each frame: camera to world 16 f32 | two times u64 | colour bytes u64 | depth bytes u64 | colour | depth

and measurements of motion behind, which are not read. https://github.com/ScanNet/ScanNet (SensReader)
"""

from __future__ import annotations

import io
import struct
import zlib
from dataclasses import dataclass
from pathlib import Path
from typing import BinaryIO

import numpy as np
from jaxtyping import Float32, Float64, Int64

from semgs.files.errors import InputError

VERSION = 4
COLOUR_CODECS = {-1: "unknown", 0: "raw", 1: "png", 2: "jpeg"}
DEPTH_CODECS = {-1: "unknown", 0: "raw_ushort", 1: "zlib_ushort", 2: "occi_ushort"}
JPEG, ZLIB = 2, 1
"""The codecs that are read; ScanNet's release has no others."""

LONGEST_NAME = 4096
"""A sensor has no longer name than this; a file that says so is none of ours [bytes]."""
MOST_PIXELS = 1 << 28
"""Nor a picture more pixels."""
EXTRINSIC_TOLERANCE = 1e-3

_UNWRITTEN = bytes(4)
"""How depth ends that was never written: its checksum would be there, which is as good as never 0."""

_BEGINNING = struct.Struct("<IQ")
_HEADER = struct.Struct("<64f2i4IfQ")
_FRAME = struct.Struct("<16f4Q")


@dataclass(frozen=True, slots=True)
class SensColour:
    """The picture of a frame, a JPEG inside the recording.

    Attributes:
        path: the recording.
        frame: its number.
        start: where the bytes begin.
        length: how many they are.
    """

    path: Path
    frame: int
    start: int
    length: int

    @property
    def name(self) -> str:
        """As ScanNet's exporter names it."""
        return f"{self.frame}.jpg"

    @property
    def suffix(self) -> str:
        """It is a JPEG."""
        return ".jpg"

    def is_file(self) -> bool:
        """Whether the recording is there."""
        return self.path.is_file()

    def read_bytes(self) -> bytes:
        """The JPEG.

        Raises:
            OSError: the recording cannot be read, or became shorter.
        """
        return _stretch(self.path, self.start, self.length)

    def __str__(self) -> str:
        return f"{self.path}, colour of frame {self.frame}"


@dataclass(frozen=True, slots=True)
class SensDepth:
    """The depth of a frame: counts inside the recording, as an array file [height width] uint16.

    Attributes:
        path: the recording.
        frame: its number.
        start: where the bytes begin.
        length: how many they are.
        size: (height, width).
    """

    path: Path
    frame: int
    start: int
    length: int
    size: tuple[int, int]

    @property
    def name(self) -> str:
        """The number, as an array file."""
        return f"{self.frame}.npy"

    @property
    def suffix(self) -> str:
        """What `read_bytes` gives is in NumPy's format."""
        return ".npy"

    def is_file(self) -> bool:
        """Whether the recording is there."""
        return self.path.is_file()

    def read_bytes(self) -> bytes:
        """The counts in NumPy's file format.

        Raises:
            OSError: the recording cannot be read, or the depth is not what its header says.
        """
        data = _stretch(self.path, self.start, self.length)
        expected = 2 * self.size[0] * self.size[1]
        try:
            counts = zlib.decompressobj().decompress(data, expected + 1)
        except zlib.error as error:
            raise OSError(f"depth that cannot be inflated: {error}") from error
        if len(counts) != expected:
            more = "more than " if len(counts) > expected else ""
            raise OSError(
                f"{more}{min(len(counts), expected)} bytes of depth, not the {expected} of {self.size[1]}x{self.size[0]}"
            )
        file = io.BytesIO()
        np.save(file, np.frombuffer(counts, "<u2").reshape(self.size))
        return file.getvalue()

    def __str__(self) -> str:
        return f"{self.path}, depth of frame {self.frame}"


@dataclass(frozen=True, eq=False)
class Recording:
    """What a `.sens` file holds; no picture has been read.

    Attributes:
        path: the file.
        colour_intrinsics: K of the pictures, pixel centres at whole numbers [px].
        depth_intrinsics: K of the depth, likewise.
        colour_size: (height, width) [px].
        depth_size: (height, width) [px].
        depth_unit: what a count of depth is worth [m].
        declared: how many frames the header speaks of.
        poses: camera to world of each complete frame, not finite where tracking was lost [m].
        starts: where the colour of each begins.
        colour_bytes: length of its colour; its depth lies right behind.
        depth_bytes: length of its depth.
    """

    path: Path
    colour_intrinsics: Float64[np.ndarray, "3 3"]
    depth_intrinsics: Float64[np.ndarray, "3 3"]
    colour_size: tuple[int, int]
    depth_size: tuple[int, int]
    depth_unit: float
    declared: int
    poses: Float32[np.ndarray, "n 4 4"]
    starts: Int64[np.ndarray, " n"]
    colour_bytes: Int64[np.ndarray, " n"]
    depth_bytes: Int64[np.ndarray, " n"]

    def __len__(self) -> int:
        """The number of complete frames."""
        return len(self.starts)

    def colour(self, frame: int) -> SensColour:
        """The picture of a frame."""
        return SensColour(self.path, frame, int(self.starts[frame]), int(self.colour_bytes[frame]))

    def depth(self, frame: int) -> SensDepth | None:
        """The depth of a frame, None where there is none."""
        if not self.depth_bytes[frame]:
            return None
        start = int(self.starts[frame] + self.colour_bytes[frame])
        return SensDepth(self.path, frame, start, int(self.depth_bytes[frame]), self.depth_size)


def read_recording(path: Path) -> Recording:
    """Walk a `.sens` file from frame to frame, without reading the pictures.

    It ends at the first frame that is not whole: what a download left off (also where zeros stand in its place). Nothing is set aside
    for frames that the header speaks of.

    Raises:
        InputError: it cannot be read, is no such file, is of another version or has other codecs than JPEG and zlib, its depth is not
            aligned with its colour, or its header is cut short.
    """
    try:
        with path.open("rb", buffering=0) as file:
            return _read(path, file, path.stat().st_size)
    except OSError as error:
        raise InputError(path, "a readable file", error.strerror or str(error)) from error


def _read(path: Path, file: BinaryIO, length: int) -> Recording:
    """The recording in an open file.

    Raises:
        InputError: as `read_recording`.
        OSError: it cannot be read.
    """
    version, name = _BEGINNING.unpack(_header(path, file, _BEGINNING.size))
    if version != VERSION:
        raise InputError(path, f"a .sens file of version {VERSION}", f"{version}", key="version")
    if name > LONGEST_NAME:
        raise InputError(path, "a .sens file", f"a sensor whose name has {name} bytes", key="name")
    file.seek(name, 1)
    *matrices, colour, depth, width, height, depth_width, depth_height, shift, declared = _HEADER.unpack(
        _header(path, file, _HEADER.size)
    )
    for kind, codec, codecs, read in (
        ("colour", colour, COLOUR_CODECS, JPEG),
        ("depth", depth, DEPTH_CODECS, ZLIB),
    ):
        if codec != read:
            raise InputError(path, codecs[read], codecs.get(codec, f"number {codec}"), key=f"codec of {kind}")
    if not 0 < shift < float("inf"):
        raise InputError(path, "a positive number of counts a metre", f"{shift:g}", key="depth shift")
    for kind, pixels in (("colour", width * height), ("depth", depth_width * depth_height)):
        if not 0 < pixels <= MOST_PIXELS:
            raise InputError(path, f"1 to {MOST_PIXELS} pixels", f"{pixels}", key=f"size of {kind}")
    cameras = np.array(matrices, np.float64).reshape(4, 4, 4)
    for kind, extrinsic in (("colour", cameras[1]), ("depth", cameras[3])):
        if not np.abs(extrinsic - np.eye(4)).max() <= EXTRINSIC_TOLERANCE:
            raise InputError(
                path,
                "depth aligned with colour (extrinsics that are the identity), as ScanNet releases it",
                f"{np.round(extrinsic[:3], 4).tolist()}",
                key=f"extrinsic of {kind}",
                advice="calibrate the recording with ScanNet's tool first",
            )
    return Recording(
        path,
        cameras[0, :3, :3].copy(),
        cameras[2, :3, :3].copy(),
        (height, width),
        (depth_height, depth_width),
        1 / shift,
        declared,
        *_frames(file, length, declared),
    )


def _frames(
    file: BinaryIO, length: int, declared: int
) -> tuple[Float32[np.ndarray, "n 4 4"], Int64[np.ndarray, " n"], Int64[np.ndarray, " n"], Int64[np.ndarray, " n"]]:
    """Poses, starts, colour bytes and depth bytes of the complete frames from here on, at most as many as declared."""
    poses = bytearray()
    places: list[tuple[int, int, int]] = []
    position = file.tell()
    while len(places) < declared:
        file.seek(position)
        header = file.read(_FRAME.size)
        if len(header) < _FRAME.size:
            break
        colour, depth = _FRAME.unpack(header)[-2:]
        start = position + _FRAME.size
        if not colour or start + colour + depth > length:
            break
        file.seek(start + colour + depth - len(_UNWRITTEN))
        if depth and file.read(len(_UNWRITTEN)) == _UNWRITTEN:
            break
        poses += header[:64]
        places.append((start, colour, depth))
        position = start + colour + depth
    table = np.array(places, np.int64).reshape(-1, 3)
    return np.frombuffer(bytes(poses), "<f4").reshape(-1, 4, 4), table[:, 0], table[:, 1], table[:, 2]


def _header(path: Path, file: BinaryIO, count: int) -> bytes:
    """The next bytes of the header.

    Raises:
        InputError: the file ends before.
        OSError: it cannot be read.
    """
    data = file.read(count)
    if len(data) < count:
        raise InputError(path, "a .sens file", "one that ends in its header", advice="download it again")
    return data


def _stretch(path: Path, start: int, length: int) -> bytes:
    """Bytes of a file.

    Raises:
        OSError: it cannot be read, or ends before.
    """
    with path.open("rb") as file:
        file.seek(start)
        data = file.read(length)
    if len(data) < length:
        raise OSError("a recording that ends before")
    return data
