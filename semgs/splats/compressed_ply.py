"""Compressed PLY files of SuperSplat and splat-transform (*.compressed.ply): 16 bytes a Gaussian, and harmonics of 8 bits.

Gaussians come in chunks of 256. The element `chunk` has the bounds of each: min_x .. max_z, min_scale_x .. max_scale_z (of the logarithms) and, in newer files,
min_r .. max_b. The element `vertex` has four unsigned integers for each Gaussian:

    packed_position, packed_scale    11, 10 and 11 bits from the top: x, y, z between the bounds of the chunk
    packed_rotation                  2 bits: which of w, x, y, z is the largest; then 10 bits for each of the others, from -1/sqrt 2 to 1/sqrt 2
    packed_color                     8 bits for each of red, green, blue, between the bounds of the chunk, and opacity, 0..1

Colours are 0.5 + the constant harmonic times its basis. The optional element `sh` has 9, 24 or 45 bytes f_rest_0 ...: a byte b is (b + 0.5) / 256, where 0 is 0 and 255
is 1, and a harmonic is 8 times that, minus 4. Sources: https://github.com/playcanvas/splat-transform (src/lib/readers/decompress-ply.ts, MIT), and
https://developer.playcanvas.com/user-manual/gaussian-splatting/formats/ply/.
"""

from __future__ import annotations

from pathlib import Path

import numpy as np

from semgs.data.ply_tables import PlyTables
from semgs.files.errors import InputError
from semgs.geometry.harmonics import DEGREE_0
from semgs.splats.plain_ply import VERTEX, Columns, by_coefficient, rest_names, together
from semgs.splats.splat import Splat, check_all, check_count, make_gaussians, note_left_out, with_largest

CHUNK, HARMONICS = "chunk", "sh"
CHUNK_SIZE = 256
"""Gaussians that share their bounds."""

PACKED = ("packed_position", "packed_rotation", "packed_scale", "packed_color")
BOUNDS = tuple(f"{end}_{what}" for what in ("x", "y", "z", "scale_x", "scale_y", "scale_z") for end in ("min", "max"))
COLOUR_BOUNDS = tuple(f"{end}_{what}" for what in "rgb" for end in ("min", "max"))

HARMONICS_RANGE = 8.0
"""Harmonics are from -4 to 4."""


def is_compressed(ply: PlyTables) -> bool:
    """Whether a PLY says that it is compressed."""
    return CHUNK in ply.tables or any(name in ply.tables.get(VERTEX, {}) for name in PACKED)


def read_compressed_ply(path: Path, ply: PlyTables) -> Splat:
    """The splat of a compressed PLY.

    Args:
        path: the file, for errors.
        ply: its tables.

    Raises:
        InputError: a property or an element is missing, counts disagree, or a number is not finite.
    """
    columns, bounds = ply.tables.get(VERTEX, {}), ply.tables.get(CHUNK, {})
    wanted = (*BOUNDS, *(COLOUR_BOUNDS if any(name in bounds for name in COLOUR_BOUNDS) else ()))
    missing = [name for name in PACKED if name not in columns] + [name for name in wanted if name not in bounds]
    if missing:
        raise InputError(path, f"{missing[0]}, as in a compressed PLY", "none")
    wrong = [name for name in PACKED if columns[name].dtype.kind != "u" or columns[name].dtype.itemsize != 4]
    if wrong:
        raise InputError(path, "32-bit unsigned integers", str(columns[wrong[0]].dtype), wrong[0])
    count = ply.counts[VERTEX]
    check_count(path, count, "element vertex")
    if ply.counts[CHUNK] != -(-count // CHUNK_SIZE):
        found = f"{ply.counts[CHUNK]:,} for {count:,} Gaussians"
        raise InputError(path, f"a chunk for each {CHUNK_SIZE} Gaussians", found, "element chunk")
    limits = together(bounds, wanted)
    check_all(path, "bounds", limits, np.isfinite(limits), "finite numbers (in chunks)")
    chunks = np.arange(count) // CHUNK_SIZE
    position, rotation, scale, colour = (columns[name].astype(np.uint32) for name in PACKED)
    reds = _shares(colour, ((24, 8), (16, 8), (8, 8), (0, 8)))
    shown = _between(bounds, ("r", "g", "b"), chunks, reds[:, :3]) if len(wanted) > len(BOUNDS) else reds[:, :3]
    with np.errstate(over="ignore"):
        scales = np.exp(_between(bounds, ("scale_x", "scale_y", "scale_z"), chunks, _three(scale)))
    constant = ((shown - 0.5) / DEGREE_0)[:, None].astype(np.float32)
    usable = make_gaussians(
        path,
        means=_between(bounds, ("x", "y", "z"), chunks, _three(position)),
        opacities=reds[:, 3],
        scales=scales,
        quaternions=_rotations(rotation),
        harmonics=np.concatenate((constant, _harmonics(path, ply, count)), axis=1),
    )
    return Splat(
        usable.gaussians,
        "compressed PLY",
        "-y",
        extra={name: values[usable.kept] for name, values in columns.items() if name not in PACKED},
        comments=ply.comments,
    ).noted(*note_left_out(count - len(usable.gaussians), count))


def _shares(packed: np.ndarray, fields: tuple[tuple[int, int], ...]) -> np.ndarray:
    """Fields of bits as numbers from 0 to 1 [g n]; each is (its lowest bit, how many)."""
    parts = [(packed >> np.uint32(low)) & np.uint32((1 << bits) - 1) for low, bits in fields]
    largest = np.array([(1 << bits) - 1 for _, bits in fields], np.float64)
    return np.stack(parts, axis=-1) / largest


def _three(packed: np.ndarray) -> np.ndarray:
    """Three numbers of 11, 10 and 11 bits, 0..1."""
    return _shares(packed, ((21, 11), (11, 10), (0, 11)))


def _between(bounds: Columns, names: tuple[str, ...], chunks: np.ndarray, shares: np.ndarray) -> np.ndarray:
    """Numbers between the bounds of their chunk [g n]."""
    low, high = (together(bounds, tuple(f"{end}_{name}" for name in names))[chunks] for end in ("min", "max"))
    return low * (1 - shares) + high * shares


def _rotations(packed: np.ndarray) -> np.ndarray:
    """Quaternions (w, x, y, z) [g 4]."""
    others = (_shares(packed, ((20, 10), (10, 10), (0, 10))) - 0.5) * 2**0.5
    return with_largest(others, (packed >> np.uint32(30)).astype(np.int64))


def _harmonics(path: Path, ply: PlyTables, count: int) -> np.ndarray:
    """Harmonics above degree 0 [g k 3], k = 0 without the element."""
    columns = ply.tables.get(HARMONICS)
    if columns is None:
        return np.empty((count, 0, 3), np.float32)
    names = rest_names(path, columns)
    if ply.counts[HARMONICS] != count:
        found = f"{ply.counts[HARMONICS]:,} for {count:,} Gaussians"
        raise InputError(path, "harmonics for each Gaussian", found, "element sh")
    if not names:
        return np.empty((count, 0, 3), np.float32)
    wrong = [name for name in names if columns[name].dtype != np.uint8]
    if wrong:
        raise InputError(path, "bytes", str(columns[wrong[0]].dtype), wrong[0])
    steps = (np.arange(256) + 0.5) / 256
    steps[0], steps[-1] = 0, 1
    table = ((steps - 0.5) * HARMONICS_RANGE).astype(np.float32)
    return table[by_coefficient(columns, names).astype(np.uint8)]
