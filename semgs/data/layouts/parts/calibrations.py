"""Calibrations: the intrinsics of a recording, from text and JSON files.

All of them have the centre of the first pixel at (0, 0), like OpenCV's calibration and the defaults of camera drivers. Half a pixel is added
to cx and cy here.

    3x3 or 4x4 matrix      3DMatch, SUN3D, ScanNet's exports
    fx fy cx cy            ETH3D's calibration.txt
    KEY = numbers          info.txt of BundleFusion, 12-Scenes, 3RScan
    JSON                   fx, fy, cx, cy, or a matrix, or Open3D's `intrinsic_matrix`; perhaps in an object "camera"
    YAML                   `camera_matrix` as OpenCV, ROS and RTAB-Map write it
"""

from __future__ import annotations

import math
import re
from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from semgs.data.cameras.lens import HALF, Lens
from semgs.data.layouts.parts.fields import Fields, read_fields
from semgs.data.layouts.parts.text_numbers import read_pairs, read_rows
from semgs.data.scene_details import SceneDetails
from semgs.files.contents import read_text
from semgs.files.errors import InputError, input_error
from semgs.files.stored import Stored

MATRICES = ("intrinsic_matrix", "camera_matrix", "K", "cam_K", "intrinsic", "intrinsics", "matrix")
YAML = (".yaml", ".yml")
INSIDE = ("camera", "color", "colour", "rgb", "intrinsics", "intrinsic")
"""Keys of matrices in JSON files, and of objects that may contain the intrinsics."""


@dataclass(frozen=True)
class Calibration:
    """The pinhole camera of a recording.

    Attributes:
        focal: (fx, fy) [px].
        centre: (cx, cy) [px], the centre of the first pixel at (0.5, 0.5).
        size: (height, width) of its images; None if unknown.
        source: the file that it is from; None for a constant of the layout or the user's values.
        depth_unit: metres per count of the depth maps [m], if the file says so.
        depth_lens: the pinhole of a separate depth camera, if the file has one.
        of_a_sensor: whether it belongs to a known sensor, so it can be scaled to images of another size with the same aspect.
    """

    focal: tuple[float, float]
    centre: tuple[float, float]
    size: tuple[int, int] | None = None
    source: Stored | None = None
    depth_unit: float | None = None
    depth_lens: Lens | None = None
    of_a_sensor: bool = False

    def lens(self, picture: Stored, size: tuple[int, int]) -> Lens:
        """The lens for images of a size (height, width).

        Raises:
            InputError: the calibration is for another size, or its principal point is outside the images.
        """
        place = self.source or picture
        if self.size is not None and self.size != size:
            scale = size[0] / max(self.size[0], 1)
            if self.of_a_sensor and size[0] * self.size[1] == size[1] * self.size[0]:
                fx, fy, cx, cy = (scale * number for number in (*self.focal, *self.centre))
                return replace(self, focal=(fx, fy), centre=(cx, cy), size=size).lens(picture, size)
            raise InputError(
                place, f"intrinsics for {size[1]}x{size[0]} pixels (width x height), the size of {picture.name}",
                f"some for {self.size[1]}x{self.size[0]}", advice="give intrinsics of these images (--intrinsics fx fy cx cy)",
            )  # fmt: skip
        if not (0 < self.centre[0] < size[1] and 0 < self.centre[1] < size[0]):
            raise InputError(
                place, f"a principal point inside images of {size[1]}x{size[0]} (width x height)",
                f"({self.centre[0]:g}, {self.centre[1]:g})", advice="these intrinsics seem to be for images of another size",
            )  # fmt: skip
        with input_error(place, "a possible camera"):
            return Lens(size, self.focal, self.centre)


def calibration_from_details(details: SceneDetails) -> Calibration | None:
    """The calibration that the user gave, None if there is none."""
    if details.intrinsics is None:
        return None
    fx, fy, cx, cy = details.intrinsics
    return Calibration((fx, fy), (cx, cy))


def read_calibration(path: Path) -> Calibration:
    """The calibration in a file of one of the forms above.

    Raises:
        InputError: it cannot be read, or has another form.
    """
    if path.suffix.lower() == ".json":
        return _from_json(path)
    if path.suffix.lower() in YAML:
        return _from_yaml(path)
    if path.name in ("info.txt", "_info.txt"):
        return _from_info(path)
    return calibration_of(path, [value for _, values in read_rows(path) for value in values])


def calibration_of(path: Path, numbers: Sequence[float], key: str | None = None) -> Calibration:
    """The calibration from fx, fy, cx, cy or a camera matrix, with the centre of the first pixel at (0, 0).

    Args:
        path: the file that they are from.
        numbers: 4, or the 9, 12 or 16 of a 3x3, 3x4 or 4x4 matrix.
        key: their place there.

    Raises:
        InputError: there is another number of them, it is not a camera matrix, a number is not finite, or a focal length is not positive.
    """
    if len(numbers) not in (4, 9, 12, 16):
        found = f"{len(numbers)} numbers"
        raise InputError(path, "intrinsics as a 3x3 or 4x4 matrix or as fx fy cx cy", found, key)
    fx, fy, cx, cy = four = list(numbers) if len(numbers) == 4 else _of_matrix(path, numbers, key)
    if not np.isfinite(four).all() or min(fx, fy) <= 0:
        raise InputError(path, "finite intrinsics with positive focal lengths", f"fx fy cx cy = {four}", key)
    return Calibration((fx, fy), (cx + HALF, cy + HALF), source=path)


def _of_matrix(path: Path, numbers: Sequence[float], key: str | None) -> list[float]:
    """fx, fy, cx, cy of a matrix in row order, or in column order as Open3D writes 3x3; the zeros show which."""
    square = np.array(numbers).reshape(-1, 3 if len(numbers) == 9 else 4)[:3, :3]
    if square[2, 0] and not square[0, 2]:
        square = square.T
    if np.abs(square[[1, 2, 2], [0, 0, 1]]).max() > 1e-6 or abs(square[2, 2] - 1) > 1e-6 or abs(square[0, 1]) > 1:
        raise InputError(path, "a camera matrix [fx 0 cx; 0 fy cy; 0 0 1]", f"{square.tolist()}", key)
    return [float(square[place]) for place in ((0, 0), (1, 1), (0, 2), (1, 2))]


def _from_json(path: Path) -> Calibration:
    """The calibration in a JSON file."""
    outer = read_fields(path)
    inner = next((outer.values[key] for key in INSIDE if isinstance(outer.values.get(key), dict)), None)
    fields = Fields(path, inner, "", outer) if inner else outer
    size = fields.size("width", "height") or fields.size("w", "h")
    unit = _depth_unit(fields)
    four = [number for key in ("fx", "fy", "cx", "cy") if (number := fields.number(key)) is not None]
    if len(four) == 4:
        return replace(calibration_of(path, four, "fx"), size=size, depth_unit=unit)
    for key in MATRICES:
        matrix = fields.array(key)
        if matrix is not None and matrix.size in (9, 16):
            return replace(calibration_of(path, matrix.ravel().tolist(), key), size=size, depth_unit=unit)
    raise InputError(path, "intrinsics as fx, fy, cx, cy or as a matrix", "keys " + ", ".join(sorted(outer.values)))


def _from_yaml(path: Path) -> Calibration:
    """The calibration in a YAML file with OpenCV's matrices. Its images must have no distortion."""
    text = read_text(path)

    def numbers(key: str, form: str) -> list[float]:
        found = re.search(rf"^[ \t]*{key}[ \t]*:{form}", text, re.MULTILINE | re.DOTALL)
        try:
            return [float(word) for word in re.split(r"[\s,]+", found[1].strip())] if found else []
        except ValueError:
            raise InputError(path, "numbers", f"{found[1]!r:.60}" if found else "none", key) from None

    of_matrix, of_side = r"(?:(?!^\S).)*?\bdata[ \t]*:\s*\[([^\]]+)\]", r"[ \t]*(\S+)"
    if any(numbers("distortion_coefficients", of_matrix)):
        raise InputError(
            path, "images without distortion", "coefficients that are not 0", "distortion_coefficients",
            "undistort the images first, or give intrinsics if they are undistorted (--intrinsics fx fy cx cy)",
        )  # fmt: skip
    matrix, sides = (
        numbers("camera_matrix", of_matrix),
        numbers("image_height", of_side) + numbers("image_width", of_side),
    )
    if len(matrix) != 9:
        raise InputError(path, "a camera_matrix with the 9 numbers of its data", f"{len(matrix)} numbers")
    size = (round(sides[0]), round(sides[1])) if len(sides) == 2 and np.isfinite(sides).all() else None
    return replace(calibration_of(path, matrix, "camera_matrix"), size=size)


def _depth_unit(fields: Fields) -> float | None:
    """Metres per count of the depth maps [m], if the file says so.

    Some programs write counts per metre (1000), others metres per count (0.001). Only 1 is ambiguous, and ignored.
    """
    for key in ("scale", "depth_scale", "depth_factor", "png_depth_scale", "depth_unit_scale_factor"):
        scale = fields.positive(key)
        if scale is not None and scale != 1:
            return scale if scale < 1 else 1 / scale
    return None


def _from_info(path: Path) -> Calibration:
    """The calibration in an info.txt: lines KEY = VALUES."""
    held = read_pairs(path)
    try:
        shift = float(held.get("m_depthShift", 1000))
    except ValueError:
        shift = math.nan
    if not shift > 0:
        raise InputError(path, "a positive number of counts per metre", f"{held['m_depthShift']!r:.40}", "m_depthShift")
    colour = _of_info(path, held, "Color", "color")
    if "m_calibrationDepthIntrinsic" not in held:
        return replace(colour, depth_unit=1 / shift)
    depth = _of_info(path, held, "Depth", "depth")
    assert depth.size is not None
    return replace(colour, depth_unit=1 / shift, depth_lens=depth.lens(path, depth.size))


def _of_info(path: Path, held: dict[str, str], name: str, sides: str) -> Calibration:
    """The calibration of one camera in an info.txt."""
    key = f"m_calibration{name}Intrinsic"
    try:
        flat = [float(word) for word in held[key].split()]
        size = (int(held[f"m_{sides}Height"]), int(held[f"m_{sides}Width"]))
    except (KeyError, ValueError) as error:
        found = f"none that can be read: {error}"
        raise InputError(path, f"{key}, m_{sides}Height and m_{sides}Width", found) from error
    return replace(calibration_of(path, flat, key), size=size)
