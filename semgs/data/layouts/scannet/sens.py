"""`.sens`, ScanNet's recordings: the places of each frame's colour and depth in the file. They are read only when needed.

    version u32 = 4 | name u64 + bytes | colour K, colour extrinsic, depth K, depth extrinsic: 16 f32 each, row by row
    colour codec i32 | depth codec i32 | colour width, height, depth width, height: u32 | depth counts per metre f32 | frames u64
    each frame: camera to world 16 f32 | two times u64 | colour bytes u64 | depth bytes u64 | colour | depth

then motion measurements, which are not read. https://github.com/ScanNet/ScanNet (SensReader)
"""

from __future__ import annotations

import io
import struct
import zlib
from dataclasses import dataclass
from pathlib import Path
from typing import BinaryIO, final

import numpy as np
from jaxtyping import Float32, Float64, Int64

from semgs.files.errors import InputError, readable

VERSION = 4
COLOUR_CODECS = {-1: "unknown", 0: "raw", 1: "png", 2: "jpeg"}
DEPTH_CODECS = {-1: "unknown", 0: "raw_ushort", 1: "zlib_ushort", 2: "occi_ushort"}
JPEG, ZLIB = 2, 1
"""The supported codecs; ScanNet's release has no others."""

LONGEST_NAME = 4096
"""Longest name of a sensor [bytes]; a longer one means that the file is something else."""
MOST_PIXELS = 1 << 26
"""Most pixels of an image, likewise."""
MOST_FRAMES = 1_000_000
"""Further frames are not read; so many are nine hours of 30 a second."""
EXTRINSIC_TOLERANCE = 1e-3

_UNWRITTEN = bytes(4)
"""The end of depth that was never written. Otherwise the checksum is there, which is practically never 0."""

_BEGINNING = struct.Struct("<IQ")
_HEADER = struct.Struct("<64f2i4IfQ")
_FRAME = struct.Struct("<16f4Q")


@final
@dataclass(frozen=True, slots=True)
class SensFile:
    """The image or depth of a frame as a file: a JPEG, or a NumPy file of counts [height width] uint16.

    Attributes:
        path: the recording.
        frame: its number.
        start: offset of the bytes.
        length: number of bytes.
        size: (height, width) of the depth; None for an image.
    """

    path: Path
    frame: int
    start: int
    length: int
    size: tuple[int, int] | None = None

    @property
    def suffix(self) -> str:
        """The ending of the file."""
        return ".jpg" if self.size is None else ".npy"

    @property
    def name(self) -> str:
        """The number of the frame, as ScanNet's exporter names files."""
        return f"{self.frame}{self.suffix}"

    def is_file(self) -> bool:
        """Whether the recording exists."""
        return self.path.is_file()

    def read_bytes(self) -> bytes:
        """The file.

        Raises:
            OSError: the recording cannot be read or is truncated, or the depth does not match its header.
        """
        with self.path.open("rb") as file:
            file.seek(self.start)
            data = file.read(self.length)
        if len(data) < self.length:
            raise OSError("a truncated recording")
        return data if self.size is None else _array_file(data, self.size)

    def __str__(self) -> str:
        return f"{self.path}, {'colour' if self.size is None else 'depth'} of frame {self.frame}"


def _array_file(data: bytes, size: tuple[int, int]) -> bytes:
    """Compressed depth in NumPy's file format."""
    expected = 2 * size[0] * size[1]
    try:
        counts = zlib.decompressobj().decompress(data, expected + 1)
    except zlib.error as error:
        raise OSError(f"depth that cannot be decompressed: {error}") from error
    if len(counts) != expected:
        more = "more than " if len(counts) > expected else ""
        raise OSError(f"{more}{min(len(counts), expected)} bytes of depth, not the {expected} of {size[1]}x{size[0]}")
    file = io.BytesIO()
    np.save(file, np.frombuffer(counts, "<u2").reshape(size))
    return file.getvalue()


@dataclass(frozen=True, eq=False)
class Recording:
    """The content of a `.sens` file; images have not been read.

    Attributes:
        path: the file.
        colour_intrinsics: K of the images, the centre of the first pixel at (0, 0) [px].
        depth_intrinsics: K of the depth, likewise.
        colour_size: (height, width) [px].
        depth_size: (height, width) [px].
        depth_unit: metres per count of depth [m].
        declared: number of frames in the header.
        poses: camera to world of each complete frame, not finite if tracking was lost [m].
        places: of each, the offset and length of its colour, and the length of its depth, which follows.
    """

    path: Path
    colour_intrinsics: Float64[np.ndarray, "3 3"]
    depth_intrinsics: Float64[np.ndarray, "3 3"]
    colour_size: tuple[int, int]
    depth_size: tuple[int, int]
    depth_unit: float
    declared: int
    poses: Float32[np.ndarray, "n 4 4"]
    places: Int64[np.ndarray, "n 3"]

    def __len__(self) -> int:
        """The number of complete frames."""
        return len(self.places)

    def colour(self, frame: int) -> SensFile:
        """The image of a frame."""
        start, length, _ = self.places[frame].tolist()
        return SensFile(self.path, frame, start, length)

    def depth(self, frame: int) -> SensFile | None:
        """The depth of a frame, None if there is none."""
        start, colour, depth = self.places[frame].tolist()
        return SensFile(self.path, frame, start + colour, depth, self.depth_size) if depth else None


def read_recording(path: Path) -> Recording:
    """Walk through a `.sens` file, without reading the images.

    Reading ends at the first incomplete frame, where a download stopped (the rest may be zeros). No memory is allocated for frames that are
    only declared in the header.

    Raises:
        InputError: it cannot be read, is another kind of file, has another version or other codecs than JPEG and zlib, its depth is not
            aligned with its colour, or its header is truncated.
    """
    with readable(path), path.open("rb", buffering=0) as file:
        return _read(path, file, path.stat().st_size)


def _read(path: Path, file: BinaryIO, length: int) -> Recording:
    """The recording in an open file."""
    version, name = _BEGINNING.unpack(_header(path, file, _BEGINNING.size))
    if version != VERSION:
        raise InputError(path, f"a .sens file of version {VERSION}", f"{version}", key="version")
    if name > LONGEST_NAME:
        raise InputError(path, "a .sens file", f"a sensor name of {name} bytes", key="name")
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
        raise InputError(path, "a positive number of counts per metre", f"{shift:g}", key="depth shift")
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
) -> tuple[Float32[np.ndarray, "n 4 4"], Int64[np.ndarray, "n 3"]]:
    """Poses and places of the complete frames, at most as many as declared, and at most `MOST_FRAMES`."""
    poses = bytearray()
    places: list[tuple[int, int, int]] = []
    position = file.tell()
    while len(places) < min(declared, MOST_FRAMES):
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
    return np.frombuffer(bytes(poses), "<f4").reshape(-1, 4, 4), np.array(places, np.int64).reshape(-1, 3)


def _header(path: Path, file: BinaryIO, count: int) -> bytes:
    """The next bytes of the header."""
    data = file.read(count)
    if len(data) < count:
        raise InputError(path, "a .sens file", "one that ends in its header", advice="download it again")
    return data
