"""Calibrations: the intrinsics of a recording's pictures, in the text and JSON files that they come in.

All of these have the centre of the first pixel at (0, 0), as OpenCV's calibration and the drivers' defaults have; half a pixel is added
to cx and cy here.

    3x3 or 4x4 matrix      3DMatch, SUN3D, ScanNet's exports
    fx fy cx cy            ETH3D's calibration.txt
    KEY = numbers          info.txt of BundleFusion, 12-Scenes, 3RScan
    JSON                   fx, fy, cx, cy; or a matrix; Open3D's `intrinsic_matrix`; perhaps inside an object "camera"
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np

from semgs.data.asked import Asked
from semgs.data.layouts.parts.fields import Fields, parsed
from semgs.data.layouts.parts.numbers import lines, rows
from semgs.data.lens import HALF, Lens
from semgs.files.errors import InputError

MATRICES = ("intrinsic_matrix", "camera_matrix", "K", "cam_K", "intrinsic", "intrinsics", "matrix")
INSIDE = ("camera", "color", "colour", "rgb", "intrinsics", "intrinsic")
"""Keys of JSON files that may hold a matrix, and objects that may hold the keys."""


@dataclass(frozen=True)
class Calibration:
    """The pinhole of a recording's pictures.

    Attributes:
        focal: (fx, fy) [px].
        centre: (cx, cy) [px], the centre of the first pixel at (0.5, 0.5).
        size: (height, width) that it is for, None where nobody says.
        told_by: the file that says so, or None where it is a layout's constant or the user's word.
        depth_unit: what one count of a depth map is worth [m], where the same file says so.
        depth_lens: the pinhole of the depth maps, where the same file has one of their own.
        of_a_sensor: whether it is that of a known sensor, so that pictures reduced to another size with the same aspect have it too.
    """

    focal: tuple[float, float]
    centre: tuple[float, float]
    size: tuple[int, int] | None = None
    told_by: Path | None = None
    depth_unit: float | None = None
    depth_lens: Lens | None = None
    of_a_sensor: bool = False

    def lens(self, picture: Path, size: tuple[int, int]) -> Lens:
        """The lens of pictures of a size (height, width).

        Raises:
            InputError: it is for another size, or its principal point lies outside of the pictures.
        """
        place = self.told_by or picture
        if self.size is not None and self.size != size:
            scale = size[0] / self.size[0]
            if self.of_a_sensor and size[0] * self.size[1] == size[1] * self.size[0]:
                fx, fy, cx, cy = (scale * number for number in (*self.focal, *self.centre))
                return Lens(size, (fx, fy), (cx, cy))
            raise InputError(
                place, f"intrinsics for {size[1]}x{size[0]} pixels (width x height), as {picture.name} has",
                f"some for {self.size[1]}x{self.size[0]}", advice="give intrinsics of these pictures (--intrinsics fx fy cx cy)",
            )  # fmt: skip
        if not (0 < self.centre[0] < size[1] and 0 < self.centre[1] < size[0]):
            raise InputError(
                place, f"a principal point inside pictures of {size[1]}x{size[0]} (width x height)",
                f"({self.centre[0]:g}, {self.centre[1]:g})", advice="these intrinsics seem to be for pictures of another size",
            )  # fmt: skip
        try:
            return Lens(size, self.focal, self.centre)
        except ValueError as error:
            raise InputError(place, "a camera that can be", str(error)) from error


def asked_calibration(asked: Asked) -> Calibration | None:
    """The calibration that the user gave, None where there is none."""
    if asked.intrinsics is None:
        return None
    fx, fy, cx, cy = asked.intrinsics
    return Calibration((fx, fy), (cx, cy))


def read_calibration(path: Path) -> Calibration:
    """The calibration in a file of one of the forms above.

    Raises:
        InputError: it cannot be read or has another form.
    """
    if path.suffix.lower() == ".json":
        return _from_json(path)
    if path.name in ("info.txt", "_info.txt"):
        return _from_info(path)
    held = [values for _, values in rows(path)]
    flat = [value for values in held for value in values]
    if len(flat) == 4 and len(held) == 1:
        fx, fy, cx, cy = flat
    elif len(flat) in (9, 16):
        fx, fy, cx, cy = _of_matrix(path, flat, None)
    else:
        raise InputError(path, "intrinsics as a 3x3 or 4x4 matrix or as fx fy cx cy", f"{len(flat)} numbers")
    return _integer_centres(path, None, (fx, fy, cx, cy), None)


def _integer_centres(
    path: Path, key: str | None, four: tuple[float, float, float, float], size: tuple[int, int] | None,
    depth_unit: float | None = None,
) -> Calibration:  # fmt: skip
    """The calibration of fx, fy, cx, cy that count from the centre of the first pixel.

    Raises:
        InputError: a number is not finite or a focal length is not positive.
    """
    fx, fy, cx, cy = four
    if not np.isfinite(four).all() or min(fx, fy) <= 0:
        raise InputError(path, "finite intrinsics with positive focal lengths", f"fx fy cx cy = {list(four)}", key)
    return Calibration((fx, fy), (cx + HALF, cy + HALF), size, path, depth_unit)


def _of_matrix(path: Path, flat: list[float], key: str | None) -> tuple[float, float, float, float]:
    """fx, fy, cx, cy of a 3x3 or 4x4 matrix, row by row, or, as Open3D writes 3x3, column by column; the zeros tell.

    Raises:
        InputError: it is no camera matrix.
    """
    side = 3 if len(flat) == 9 else 4
    square = np.array(flat).reshape(side, side)[:3, :3]
    if square[2, 0] and not square[0, 2]:
        square = square.T
    if np.abs(square[[1, 2, 2], [0, 0, 1]]).max() > 1e-6 or abs(square[2, 2] - 1) > 1e-6 or abs(square[0, 1]) > 1:
        raise InputError(path, "a camera matrix [fx 0 cx; 0 fy cy; 0 0 1]", f"{square.tolist()}", key)
    return float(square[0, 0]), float(square[1, 1]), float(square[0, 2]), float(square[1, 2])


def _from_json(path: Path) -> Calibration:
    """The calibration of a JSON file.

    Raises:
        InputError: it holds none.
    """
    whole = parsed(path)
    inner = next((whole.values[key] for key in INSIDE if isinstance(whole.values.get(key), dict)), None)
    fields = Fields(path, inner, "", whole) if inner else whole
    width, height = fields.whole("width") or fields.whole("w"), fields.whole("height") or fields.whole("h")
    size = (height, width) if width and height else None
    unit = _depth_unit(fields)
    four = tuple(fields.number(key) for key in ("fx", "fy", "cx", "cy"))
    if None not in four:
        return _integer_centres(path, "fx", four, size, unit)  # type: ignore[arg-type]
    for key in MATRICES:
        flat = _flat(fields.value(key))
        if flat is not None:
            return _integer_centres(path, key, _of_matrix(path, flat, key), size, unit)
    raise InputError(path, "intrinsics as fx, fy, cx, cy or as a matrix", "keys " + ", ".join(sorted(whole.values)))


def _flat(value: Any) -> list[float] | None:
    """The numbers of a list or nested list of 9 or 16, None where it is something else."""
    try:
        numbers = np.array(value, dtype=np.float64).ravel()
    except (TypeError, ValueError):
        return None
    return numbers.tolist() if numbers.size in (9, 16) else None


def _depth_unit(fields: Fields) -> float | None:
    """What one count of a depth map is worth [m], if the file says so.

    Some programs write counts per metre (1000), some metres per count (0.001): which is which cannot be mistaken, but for 1.

    Raises:
        InputError: it is no positive number.
    """
    for key in ("scale", "depth_scale", "depth_factor", "png_depth_scale", "depth_unit_scale_factor"):
        scale = fields.positive(key)
        if scale is not None and scale != 1:
            return scale if scale < 1 else 1 / scale
    return None


def _from_info(path: Path) -> Calibration:
    """The calibration of an info.txt: lines KEY = VALUES.

    Raises:
        InputError: it holds none.
    """
    held = {key.strip(): text.strip() for key, _, text in (line.partition("=") for _, line in lines(path))}
    try:
        shift = float(held.get("m_depthShift", 1000))
    except ValueError:
        shift = math.nan
    if not shift > 0:
        raise InputError(path, "a positive number of counts a metre", f"{held['m_depthShift']!r:.40}", "m_depthShift")
    colour = _of_info(path, held, "Color", "color")
    if "m_calibrationDepthIntrinsic" not in held:
        return replace(colour, depth_unit=1 / shift)
    depth = _of_info(path, held, "Depth", "depth")
    assert depth.size is not None
    return replace(colour, depth_unit=1 / shift, depth_lens=depth.lens(path, depth.size))


def _of_info(path: Path, held: dict[str, str], name: str, sides: str) -> Calibration:
    """The calibration of one camera of an info.txt.

    Raises:
        InputError: its matrix or size is not there, or cannot be.
    """
    key = f"m_calibration{name}Intrinsic"
    try:
        flat = [float(word) for word in held[key].split()]
        size = (int(held[f"m_{sides}Height"]), int(held[f"m_{sides}Width"]))
    except (KeyError, ValueError) as error:
        found = f"none that can be read: {error}"
        raise InputError(path, f"{key}, m_{sides}Height and m_{sides}Width", found) from error
    if len(flat) not in (9, 16):
        raise InputError(path, "a 4x4 camera matrix", f"{held[key]!r:.60}", key)
    return _integer_centres(path, key, _of_matrix(path, flat, key), size)
