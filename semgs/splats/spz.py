"""SPZ files of Niantic, versions 2, 3 and 4.

Versions 2 and 3 are one gzip stream: 16 bytes of header, then positions, alphas, colours, scales, rotations and harmonics, each of all Gaussians. Version 4 has a header
of 32 bytes in the clear, extensions, a table of contents and a zstd stream for each of the same blocks. Little endian:

    header       magic "NGSP", version u32, count u32, degree u8, fractional bits u8, flags u8, then a zero u8; version 4: number of streams u8, offset of the table u32,
                 12 zero bytes
    table        compressed and inflated size of each stream, u64 each; the streams follow it
    positions    24-bit signed integers x, y, z, divided by 2^(fractional bits)
    alphas       u8 / 255, opacities
    colours      (u8 / 255 - 0.5) / 0.15, constant harmonics
    scales       u8 / 16 - 10, natural logarithms
    rotations    version 2: x, y, z as u8 / 127.5 - 1, w is not negative; later: u32 with 2 bits for the largest of x, y, z, w, then 10 bits for each of the others:
                 a sign and 9 bits of 0..1/sqrt 2
    harmonics    (u8 - 128) / 128, by coefficient, then red, green, blue
    extensions   type u32, length u32, content; after the blocks in versions 2 and 3

SPZ has x right, y up, z back (RUB). As the reference library and splat-transform do for PLY, y and z are negated (to RDF), so that a PLY that they convert to SPZ
comes back in its own coordinates. Sources: https://github.com/nianticlabs/spz (README.md, src/cc/load-spz.cc, extensions/README.md; MIT).
"""

from __future__ import annotations

import struct
import zlib
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from semgs.files.errors import InputError, needs_extra
from semgs.splats.splat import Splat, check_count, make_gaussians, note_left_out, with_largest

MAGIC, GZIP = b"NGSP", b"\x1f\x8b"
HEADER, STREAMS_HEADER = struct.Struct("<4sIIBBBB"), struct.Struct("<4sIIBBBBI12x")
SIZES = struct.Struct("<QQ")
RECORD = struct.Struct("<II")

VERSIONS = (2, 3, 4)
COEFFICIENTS = {0: 0, 1: 3, 2: 8, 3: 15}
"""Harmonics above the constant one, by degree."""

MOST_BITS = 23
"""Fractional bits of a 24-bit signed integer."""

ANTIALIASED, EXTENSIONS = 1, 2
"""Flags: trained with the filter of Mip-Splatting; extensions follow."""

AXES_EXTENSION = 0xADBE0003
"""Other axes than RUB (SPZ_ADOBE_coordinate_system)."""

RUB = (0, 4)
"""Its values for unspecified and RUB."""

MOST_EXTENSION_BYTES = 1 << 20

FLIP = np.array([1.0, -1.0, -1.0], np.float32)
"""From RUB to RDF, and of the x, y, z of a quaternion: a half-turn about x."""

HARMONICS_FLIP = np.array([-1, -1, 1, -1, 1, 1, -1, 1, -1, 1, -1, -1, 1, -1, 1], np.float32)
"""The same of the harmonics above degree 0: the parity of each in y and z together."""


@dataclass(frozen=True)
class Packed:
    """The blocks of a file.

    Attributes:
        version: of the file.
        count: of Gaussians.
        degree: of the harmonics.
        fractional_bits: of the positions.
        flags: of the header.
        blocks: positions, alphas, colours, scales, rotations, harmonics.
    """

    version: int
    count: int
    degree: int
    fractional_bits: int
    flags: int
    blocks: tuple[bytes, ...] = ()

    @property
    def sizes(self) -> tuple[int, ...]:
        """The size of each block [bytes]."""
        rotation = 3 if self.version == 2 else 4
        return tuple(self.count * size for size in (9, 1, 3, 3, rotation, 3 * COEFFICIENTS[self.degree]))


def is_spz(data: bytes) -> bool:
    """Whether bytes begin as an SPZ file."""
    if data[:2] != GZIP:
        return data[:4] == MAGIC
    try:
        return zlib.decompressobj(zlib.MAX_WBITS | 16).decompress(data[: 1 << 16], 4) == MAGIC
    except zlib.error:
        return False


def read_spz(path: Path, data: bytes) -> Splat:
    """The splat of an SPZ file, with x right, y down, z forward.

    Args:
        path: the file, for errors.
        data: its bytes.

    Raises:
        InputError: it is damaged, of another version, has harmonics of degree 4 or other axes.
        ImportError: it has version 4, and zstandard is not installed.
    """
    packed = _inflated(path, data) if data[:2] == GZIP else _streams(path, data)
    positions, alphas, colours, scales, rotations, harmonics = (
        np.frombuffer(block, np.uint8) for block in packed.blocks
    )
    count = packed.count
    low, middle, high = positions.reshape(count, 3, 3).astype(np.int32).transpose(2, 0, 1)
    fixed = (low | middle << 8 | high << 16) << 8 >> 8  # extends the sign
    constant = (colours.reshape(count, 1, 3) / 255 - 0.5) / 0.15
    rest = (harmonics.reshape(count, -1, 3).astype(np.float32) - 128) / 128
    rest *= HARMONICS_FLIP[: rest.shape[1], None]
    quaternions = _first_three(rotations) if packed.version == 2 else _smallest_three(rotations)
    quaternions[:, 1:] *= FLIP
    usable = make_gaussians(
        path,
        means=fixed / 2.0**packed.fractional_bits * FLIP,
        opacities=alphas / 255,
        scales=np.exp(scales.reshape(count, 3) / 16 - 10),
        quaternions=quaternions,
        harmonics=np.concatenate((constant.astype(np.float32), rest), axis=1),
    )
    comments = [f"SPZ version {packed.version}"]
    if packed.flags & ANTIALIASED:
        comments.append("trained with antialiasing (Mip-Splatting), which our renderer does not have")
    left_out = note_left_out(count - len(usable.gaussians), count)
    return Splat(usable.gaussians, "SPZ", "-y", comments=tuple(comments)).noted(*left_out)


def _start(path: Path, header: bytes, versions: tuple[int, ...]) -> Packed:
    """What the first 16 bytes say, checked."""
    if len(header) < HEADER.size:
        raise InputError(path, "an SPZ file", "the end of it inside the header")
    magic, version, count, degree, bits, flags, _ = HEADER.unpack_from(header)
    if magic != MAGIC:
        raise InputError(path, "an SPZ file", f"{magic!r} in place of {MAGIC!r}")
    if version not in versions:
        wanted = versions if version in VERSIONS else VERSIONS
        raise InputError(path, f"SPZ of version {' or '.join(map(str, wanted))}", f"version {version}")
    if degree not in COEFFICIENTS:
        raise InputError(path, "harmonics of degree 0 to 3", f"degree {degree}", "header")
    if bits > MOST_BITS:
        raise InputError(path, f"at most {MOST_BITS} fractional bits", f"{bits}", "header")
    if flags & ~(ANTIALIASED | EXTENSIONS):
        raise InputError(path, "flags that are known (1 and 2)", f"{flags}", "header")
    check_count(path, count, "header")
    return Packed(version, count, degree, bits, flags)


def _inflated(path: Path, data: bytes) -> Packed:
    """The blocks of one gzip stream. No more is inflated than the header says."""
    stream = zlib.decompressobj(zlib.MAX_WBITS | 16)
    try:
        packed = _start(path, stream.decompress(data, HEADER.size), VERSIONS[:2])
        blocks = []
        for size in packed.sizes:
            blocks.append(stream.decompress(stream.unconsumed_tail, size) if size else b"")
            if len(blocks[-1]) != size:
                raise InputError(path, f"{size:,} bytes in each block of {packed.count:,} Gaussians", "fewer")
        most = MOST_EXTENSION_BYTES if packed.flags & EXTENSIONS else 0
        rest = stream.decompress(stream.unconsumed_tail, most + 1)
    except zlib.error as error:
        raise InputError(path, "a gzip stream that can be inflated", str(error)) from error
    if len(rest) > most or not stream.eof or stream.unused_data:
        raise InputError(path, f"the end after {packed.count:,} Gaussians", "more, or a stream that is cut off")
    if most:
        _check_extensions(path, rest)
    return Packed(**(vars(packed) | {"blocks": tuple(blocks)}))


def _streams(path: Path, data: bytes) -> Packed:
    """The blocks of the streams of version 4. No more is inflated than the header says."""
    packed = _start(path, data, VERSIONS[2:])
    if len(data) < STREAMS_HEADER.size:
        raise InputError(path, "an SPZ file", "the end of it inside the header")
    *_, streams, table = STREAMS_HEADER.unpack_from(data)
    sizes = [size for size in packed.sizes if size]
    if streams != len(sizes):
        raise InputError(path, f"{len(sizes)} streams", f"{streams}", "header")
    first = table + streams * SIZES.size
    if not STREAMS_HEADER.size <= table <= STREAMS_HEADER.size + MOST_EXTENSION_BYTES or first > len(data):
        raise InputError(path, "a table of contents inside the file", f"one at byte {table:,}", "header")
    if packed.flags & EXTENSIONS:
        _check_extensions(path, data[STREAMS_HEADER.size : table])
    elif table != STREAMS_HEADER.size:
        raise InputError(path, "the table of contents behind the header", f"one at byte {table:,}", "header")
    blocks, start = [], first
    for number, size in enumerate(sizes):
        length, inflated = SIZES.unpack_from(data, table + number * SIZES.size)
        if inflated != size or start + length > len(data):
            found = f"{length:,} bytes for {inflated:,} of {size:,}"
            raise InputError(path, "streams inside the file, of the sizes of its Gaussians", found, f"stream {number}")
        blocks.append(_unpack(path, data[start : start + length], size, f"stream {number}"))
        start += length
    if start != len(data):
        raise InputError(path, "the end after the last stream", f"{len(data) - start:,} bytes more")
    return Packed(**(vars(packed) | {"blocks": (*blocks, *[b""] * (len(packed.sizes) - len(sizes)))}))


def _unpack(path: Path, data: bytes, size: int, place: str) -> bytes:
    """A zstd stream of known size."""
    with needs_extra("spz", "SPZ files of version 4 need zstandard", "zstandard"):
        import zstandard
    try:
        with zstandard.ZstdDecompressor(max_window_size=1 << 27).stream_reader(data) as reader:
            block = reader.read(size + 1)
    except zstandard.ZstdError as error:
        raise InputError(path, "a zstd stream that can be inflated", str(error), place) from error
    if len(block) != size:
        raise InputError(path, f"{size:,} bytes", "more" if len(block) > size else f"{len(block):,}", place)
    return block


def _check_extensions(path: Path, data: bytes) -> None:
    """Check that no extension changes what the blocks mean."""
    for kind, content in _records(path, data):
        if kind == AXES_EXTENSION and (len(content) != 4 or int.from_bytes(content, "little") not in RUB):
            raise InputError(path, "axes right, up, back", "others (extension SPZ_ADOBE_coordinate_system)")


def _records(path: Path, data: bytes) -> Iterator[tuple[int, bytes]]:
    """Type and content of each extension."""
    start = 0
    while start < len(data):
        end = start + RECORD.size
        kind, length = RECORD.unpack_from(data, start) if end <= len(data) else (0, len(data))
        if end + length > len(data):
            raise InputError(path, "extensions that are complete", "one that is cut off", f"extension at {start}")
        yield kind, data[end : end + length]
        start = end + length


def _first_three(data: np.ndarray) -> np.ndarray:
    """Quaternions (w, x, y, z) of version 2 [g 4]."""
    vectors = data.reshape(-1, 3) / 127.5 - 1
    return np.column_stack((np.sqrt(np.maximum(0, 1 - (vectors**2).sum(-1))), vectors))


def _smallest_three(data: np.ndarray) -> np.ndarray:
    """Quaternions (w, x, y, z) of versions 3 and 4 [g 4]."""
    packed = data.view("<u4").astype(np.int64)
    parts = np.stack([packed >> shift & 0x3FF for shift in (20, 10, 0)], axis=-1)
    others = (parts & 0x1FF) / 0x1FF / 2**0.5 * np.where(parts & 0x200, -1, 1)
    return np.roll(with_largest(others, packed >> 30), 1, axis=-1)  # the file has x, y, z, w
