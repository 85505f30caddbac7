"""The binary files of a COLMAP model, walked from end to end to see that nothing is missing.

pycolmap takes what is behind the end of a file that was cut short for numbers: it may return wrong cameras or never return. So
the lengths are followed here first. https://colmap.github.io/format.html#binary-file-format
"""

from __future__ import annotations

import mmap
import struct
from collections.abc import Callable
from pathlib import Path

from semgs.files.errors import InputError

CAMERA_PARAMETERS = {
    0: 3, 1: 4, 2: 4, 3: 5, 4: 8, 5: 8, 6: 12, 7: 5, 8: 4, 9: 5, 10: 12, 11: 16, 12: 4, 13: 5, 14: 3, 15: 4, 16: 6, 17: 2,
}  # fmt: skip
"""How many parameters each of COLMAP's camera models has, by its number."""


def check_complete(model: Path) -> None:
    """See that the binary files of a model, where it has any, are as long as their content says.

    Raises:
        InputError: one is cut short, has something behind its end, or cannot be read.
    """
    walks = {"cameras": _camera, "images": _image, "points3D": _point, "rigs": _rig, "frames": _frame}
    for name, walk in walks.items():
        path = model / f"{name}.bin"
        if not path.is_file():
            continue
        try:
            data = path.open("rb")
        except OSError as error:
            raise InputError(path, "a readable file", error.strerror or str(error)) from error
        with data:
            length = path.stat().st_size
            try:
                end = _end(data.fileno(), length, walk)
            except KeyError as error:
                raise InputError(path, "camera models that COLMAP has", f"number {error}") from error
        if end != length:
            found = "one cut short" if end is None or end > length else f"{length - end} bytes behind their end"
            raise InputError(path, f"a complete list of COLMAP {name}", found, advice="copy or export the model again")


def _end(file: int, length: int, walk: Callable[[mmap.mmap, int], int]) -> int | None:
    """Where the content of a file ends by its own account, None if that is beyond its end."""
    if length < 8:
        return None
    with mmap.mmap(file, length, access=mmap.ACCESS_READ) as data:
        (count,) = struct.unpack_from("<Q", data)
        position = 8
        try:
            for _ in range(count):
                position = walk(data, position)
                if position > length:
                    return None
        except (struct.error, IndexError):
            return None
    return position


def _camera(data: mmap.mmap, start: int) -> int:
    """Behind the camera at `start`: id u32, model i32, width u64, height u64, parameters f64."""
    (model,) = struct.unpack_from("<i", data, start + 4)
    return start + 24 + 8 * CAMERA_PARAMETERS[model]


def _image(data: mmap.mmap, start: int) -> int:
    """Behind the image at `start`: id u32, pose 7 f64, camera u32, name until a zero byte, points (2 f64, i64) by their number u64."""
    stop = data.find(b"\0", start + 64)
    if stop < 0:
        raise IndexError(start)
    (count,) = struct.unpack_from("<Q", data, stop + 1)
    return stop + 9 + 24 * count


def _point(data: mmap.mmap, start: int) -> int:
    """Behind the point at `start`: id u64, position 3 f64, colour 3 u8, error f64, track (u32, u32) by its length u64."""
    (count,) = struct.unpack_from("<Q", data, start + 43)
    return start + 51 + 8 * count


def _rig(data: mmap.mmap, start: int) -> int:
    """Behind the rig at `start`: id u32, number of sensors u32, reference (i32, u32), others (i32, u32, u8, pose 7 f64 if that is 1)."""
    (count,) = struct.unpack_from("<I", data, start + 4)
    position = start + (16 if count else 8)
    for _ in range(1, count):
        position += 9 + (56 if data[position + 8] else 0)
    return position


def _frame(data: mmap.mmap, start: int) -> int:
    """Behind the frame at `start`: id u32, rig u32, pose 7 f64, pictures (i32, u32, u64) by their number u32."""
    (count,) = struct.unpack_from("<I", data, start + 64)
    return start + 68 + 16 * count
