"""ScanNet's cameras, from the files that its exporters write: K, and the image size that it is for."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path

from semgs.data.cameras.lens import HALF, Lens
from semgs.data.layouts.parts.calibrations import Calibration, calibration_of, read_calibration
from semgs.data.layouts.parts.text_numbers import read_pairs
from semgs.data.layouts.parts.usable_frames import first_file
from semgs.files.errors import InputError, input_error

SIZES = {"color": (968, 1296), "depth": (480, 640)}
"""Default (height, width) that ScanNet's intrinsics are for [px]."""
PLACES = ("intrinsic/intrinsic_{}.txt", "intrinsics_{}.txt", "intrinsic_{}.txt")
PEERS_ASPECT = 3 / 4
"""Height / width of the images in S-Ray's and GSNeRF's code: 972 rows for 1296 columns."""
CENTRAL = 0.1
"""Intrinsics fit an image size if the principal point is this close to the centre, relative to width and height."""


@dataclass(frozen=True)
class ScanCamera:
    """A camera of a scan.

    Attributes:
        lens: of its images.
        reference: the (height, width) that its K is for [px]; the images may have been resized.
    """

    lens: Lens
    reference: tuple[int, int]

    @property
    def as_peers(self) -> Lens:
        """The lens in S-Ray's and GSNeRF's code, as if images had an aspect of 3:4."""
        down = self.reference[0] / (PEERS_ASPECT * self.reference[1])
        (fx, fy), (cx, cy) = self.lens.focal, self.lens.centre
        return Lens(self.lens.size, (fx, fy * down), (cx, cy * down))


def has_intrinsics(folder: Path) -> bool:
    """Whether a folder contains a file with the colour camera's intrinsics."""
    return any((folder / name).is_file() for name in (*_places("color"), *_field_files(folder)))


def find_camera(folder: Path, name: str, size: tuple[int, int]) -> ScanCamera | None:
    """A camera from the files of a scan, None if there is no such file.

    Args:
        folder: the scan.
        name: "color" or "depth".
        size: (height, width) of the images [px].

    Raises:
        InputError: K is missing in a file or impossible, or its principal point is not near the centre of images of this size, of the
            size that the scan states, or of ScanNet's own.
    """
    matrix_file, field_file = (first_file((folder,), names) for names in (_places(name), _field_files(folder)))
    path, fields = matrix_file or field_file or folder, read_pairs(field_file) if field_file else {}
    calibration = read_calibration(path) if matrix_file else _calibration(path, fields, name)
    if calibration is None:
        return None
    (fx, fy), (cx, cy) = calibration.focal, calibration.centre
    for height, width in (size, _size(fields, name) or SIZES[name], SIZES[name]):
        if max(abs(cx / width - 0.5), abs(cy / height - 0.5)) <= CENTRAL:
            across, down = size[1] / width, size[0] / height
            with input_error(path, "a possible camera"):
                return ScanCamera(Lens(size, (fx * across, fy * down), (cx * across, cy * down)), (height, width))
    raise InputError(
        path,
        f"intrinsics for images of {size[1]}x{size[0]} (width x height) or of ScanNet's own size",
        f"a principal point at ({cx - HALF:g}, {cy - HALF:g})",
    )


def _places(name: str) -> tuple[str, ...]:
    """The possible files of a camera's K."""
    return tuple(place.format(name) for place in PLACES)


def _field_files(folder: Path) -> tuple[str, ...]:
    """The possible files with fields of the cameras: the C++ exporter's and the scan's own."""
    return ("_info.txt", "sensor_data/_info.txt", f"{folder.absolute().name}.txt")


def _size(fields: Mapping[str, str], name: str) -> tuple[int, int] | None:
    """(height, width) of a camera's images from `_info.txt` or `SCAN.txt`."""
    for before in (name, f"m_{name}"):
        height, width = (fields.get(f"{before}{side}", "") for side in ("Height", "Width"))
        if all(side.isdecimal() and len(side) <= 6 and int(side) for side in (height, width)):
            return int(height), int(width)
    return None


def _calibration(path: Path, fields: Mapping[str, str], name: str) -> Calibration | None:
    """The intrinsics of a camera from `_info.txt` or `SCAN.txt`."""
    four = [fields.get(f"{key}_{name}", "") for key in ("fx", "fy", "mx", "my")]
    text = fields.get(f"m_calibration{name.capitalize()}Intrinsic", " ".join(four) if all(four) else None)
    if text is None:
        return None
    key = f"intrinsics of {name}"
    with input_error(path, "a matrix of numbers", key):
        return calibration_of(path, [float(word) for word in text.split()], key)
