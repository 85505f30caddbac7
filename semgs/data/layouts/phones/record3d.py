"""Record3D: an `.r3d` file, the same as a folder (`metadata`, `rgbd/0.jpg`, `rgbd/0.depth`), or its export of EXR and JPG files
(`metadata.json`, `rgb/0.jpg`, `depth/0.exr`).

The metadata are JSON. `poses` has seven numbers for each frame, in order: qx qy qz qw tx ty tz, camera to world [m], with OpenGL axes, which
become OpenCV's by negating the second and third column. `K` is the camera matrix of the first frame column by column, for images of `w` x `h`;
`perFrameIntrinsicCoeffs`, if it is there, has fx fy cx cy of each frame. The principal point counts from the corner of the first pixel.
Depth [m] of an `.r3d` is 32-bit floats, `dw` x `dh`, compressed with LZFSE, and aligned with the image; `rgbd/0.conf` has ARKit's confidence,
0 (low) to 2, and depth of low confidence is unknown.
https://github.com/marek-simonik/record3d, issues 7, 33, 93 and 108
"""

from __future__ import annotations

import ctypes
import errno
import io
from dataclasses import dataclass
from importlib.util import find_spec
from pathlib import Path
from typing import ClassVar

import numpy as np

from semgs.data.layouts.parts.calibrations import Calibration, calibration_from_details
from semgs.data.layouts.parts.fields import Fields, read_fields
from semgs.data.layouts.parts.trajectories import FoundPose, poses_of_rows
from semgs.data.layouts.parts.usable_frames import PICTURES, Shot, ShotList
from semgs.data.layouts.phones.capture import Capture, find_capture
from semgs.data.maps import DepthMap
from semgs.data.scene import Scene
from semgs.data.scene_details import SceneDetails
from semgs.files.errors import InputError
from semgs.files.images.pictures import MOST_PIXELS
from semgs.files.stored import Stored

LAYOUT = "Record3D"
LOOKED_FOR = "an .r3d file, or metadata with rgbd/ or metadata.json with rgb/ (Record3D)"
DETAILS = ("intrinsics",)

ENDING = ".r3d"
PLACES = (("metadata", "rgbd", ENDING), ("metadata.json", "rgb", ".zip"))
"""The metadata, the folder of the images, and the ending of archives, of both kinds of export."""

_END = b"bvx$"
"""The last bytes of LZFSE data."""

_FRAMING = 64
"""More bytes than LZFSE adds to a map that it cannot compress."""


@dataclass(frozen=True, slots=True)
class LzfseFile:
    """A map that is compressed with LZFSE, Apple's format, row by row, as a `.npy` file. Read with lzfse.

    Attributes:
        compressed: the file.
        size: (height, width) of the map.
        dtype: NumPy's name of its numbers.
    """

    compressed: Stored
    size: tuple[int, int]
    dtype: str = "<f4"
    suffix: ClassVar[str] = ".npy"

    @property
    def name(self) -> str:
        """The name without folders."""
        return self.compressed.name

    def is_file(self) -> bool:
        """Whether it exists."""
        return self.compressed.is_file()

    def read_bytes(self) -> bytes:
        """The `.npy` file.

        Raises:
            OSError: it cannot be read, is damaged, or has another size.
        """
        if self.size[0] * self.size[1] > MOST_PIXELS:
            raise OSError(
                errno.EFBIG, f"a map of {self.size[1]}x{self.size[0]}; at most {MOST_PIXELS:,} pixels are read"
            )
        expected = self.size[0] * self.size[1] * np.dtype(self.dtype).itemsize
        data = self.compressed.read_bytes()
        # A longer file than its content is none of ours.
        content = _inflated(data, expected + 1) if len(data) < expected + _FRAMING else data
        if not content and expected:
            raise OSError(errno.EIO, "damaged: it is not LZFSE")
        if len(content) != expected:
            said = f"not a map of {self.size[1]}x{self.size[0]} (width x height), which has {expected} bytes"
            raise OSError(errno.EIO, said)
        buffer = io.BytesIO()
        np.save(buffer, np.frombuffer(content, self.dtype).reshape(self.size))
        return buffer.getvalue()

    def __str__(self) -> str:
        return str(self.compressed)


def recognises(path: Path) -> bool:
    """Whether a path is such a recording.

    Raises:
        InputError: it has the ending of an archive, but is not one, or is damaged.
    """
    return _found(path) is not None


def open_record3d(path: Path, details: SceneDetails) -> Scene:
    """The scene of a recording, frames in the order of their numbers.

    Args:
        path: its folder or archive.
        details: may give intrinsics.

    Raises:
        InputError: the metadata are damaged or have no poses, or fewer than two frames have an image and a pose.
    """
    found = _found(path)
    if found is None:
        raise InputError(path, LOOKED_FOR, "nothing like that")
    capture, fields, folder = found
    images = capture.numbered(folder, PICTURES)
    poses = _poses(fields)
    calibrations, given = _calibrations(fields), calibration_from_details(details)
    by_image = {image: given or calibrations[min(number, len(calibrations) - 1)] for number, image in images.items()}
    depths, notes = _depths(capture, fields, folder)
    return ShotList(
        path=path,
        layout=LAYOUT,
        shots=[Shot(f"{folder}/{image.name}", image, poses.get(number), depths.get(number)) for number, image in images.items()],
        lens=lambda image, size: by_image[image].lens(image, size),
        name=capture.name,
        unit="metric",
        notes=notes,
    ).scene()  # fmt: skip


def _found(path: Path) -> tuple[Capture, Fields, str] | None:
    """The recording at a path, its metadata, and the folder of its images; None if there is none."""
    for name, folder, ending in PLACES:
        capture = find_capture(path, name, ending)
        metadata = capture.file(name) if capture else None
        if capture and metadata and capture.numbered(folder, PICTURES):
            fields = read_fields(metadata)
            return (capture, fields, folder) if "K" in fields.values else None
    return None


def _poses(fields: Fields) -> dict[int, FoundPose]:
    """The pose of each frame, with OpenCV axes."""
    table = _table(fields, "poses", 7)
    if table is None:
        raise fields.refused("poses", "the poses of the frames", "none", "record with the LiDAR camera")
    places = [f"poses[{index}]" for index in range(len(table))]
    poses = poses_of_rows(fields.path, table[:, [4, 5, 6, 0, 1, 2, 3]], places) * (1, -1, -1, 1)
    return {index: FoundPose(pose, fields.path, places[index]) for index, pose in enumerate(poses)}


def _calibrations(fields: Fields) -> list[Calibration]:
    """The intrinsics of each frame, or those of all."""
    size = fields.size("w", "h")  # if they are missing, intrinsics are for the images as they are
    table = _table(fields, "perFrameIntrinsicCoeffs", 4)
    if table is None:
        columns = _table(fields, "K", 9)
        if columns is None:
            raise fields.refused("K", "a camera matrix, column by column", "nothing")
        table = columns[:, [0, 4, 6, 7]]
    return [
        Calibration((fx, fy), (cx, cy), size, fields.path, of_a_sensor=True) for fx, fy, cx, cy in table.tolist()
    ]  # fmt: skip


def _table(fields: Fields, key: str, columns: int) -> np.ndarray | None:
    """A list of rows of so many numbers, or one row; None if it is missing or empty."""
    value = fields.value(key)
    if value is None or value == []:
        return None
    table = fields.array(key)
    if table is None or table.ndim not in (1, 2) or table.shape[-1] != columns:
        raise fields.refused(key, f"rows of {columns} numbers", f"{value!r:.40}")
    return np.atleast_2d(table)


def _depths(capture: Capture, fields: Fields, folder: str) -> tuple[dict[int, DepthMap], list[str]]:
    """The depth map of each frame, and a note if they are left out."""
    files: dict[int, Stored] = capture.numbered(folder, (".depth",))
    if not files:
        count = len(capture.numbered("depth", (".exr",)))
        return {}, [
            f"{count} depth maps are left out because EXR is not read; share the recording as .r3d."
        ] if count else []
    size = fields.size("dw", "dh")
    if size is None:
        return {}, [f"{len(files)} depth maps are left out because {fields.path} does not say their size (dw, dh)."]
    if not can_inflate():
        return {}, [f"{len(files)} depth maps are left out because lzfse is not installed (pip install -e '.[phone]')."]
    sure = capture.numbered(folder, (".conf",))
    confidences = {number: LzfseFile(file, size, "u1") for number, file in sure.items()}
    return {
        number: DepthMap(LzfseFile(file, size), 1.0, confidence=confidences.get(number)) for number, file in files.items()
    }, []  # fmt: skip


def _inflated(data: bytes, most: int) -> bytes:
    """The first bytes that LZFSE data become, at most `most` of them; none if they are not LZFSE."""
    import lzfse

    try:
        # `lzfse.decompress` doubles its buffer until damaged data fit, which they may never do. The function below it has a limit.
        decode = ctypes.CDLL(lzfse.__file__).lzfse_decode_buffer
    except (AttributeError, OSError):  # a build that hides the function
        try:
            return bytes(lzfse.decompress(data)[:most]) if data.endswith(_END) else b""
        except lzfse.error:
            return b""
    decode.restype, size, place = ctypes.c_size_t, ctypes.c_size_t, ctypes.c_void_p
    decode.argtypes = [place, size, ctypes.c_char_p, size, place]
    buffer = ctypes.create_string_buffer(most)
    length = decode(buffer, most, data, len(data), None)
    return ctypes.string_at(buffer, length)


def can_inflate() -> bool:
    """Whether lzfse is installed (`pip install -e '.[phone]'`)."""
    return find_spec("lzfse") is not None
