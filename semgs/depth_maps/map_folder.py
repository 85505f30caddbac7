"""Depth maps in files, from any tool.

    DIR/depth.json              optional: what the numbers mean, such as {"meaning": "metric", "unit": 0.001, "licence": "MIT"}
    DIR/color/0.npy             the map of the photo color/0.jpg: numbers [height width], or
    DIR/color/0.npz             one array, or
    DIR/color/0.exr             a channel named Z, Y or R, or the only one, or
    DIR/color/0.png             16 bits, 0 and 65535 unknown
    DIR/color/0.tiff            the same, or floating-point numbers
    DIR/0.npy, ...              the same, if no other frame of the scene has that file name without its ending

A map covers the whole photo as it is stored, distortion included, and may have another size with the same aspect. NaN, infinity and, in depths,
numbers that are not positive mean unknown.
"""

from __future__ import annotations

from collections import Counter
from dataclasses import dataclass
from pathlib import Path
from typing import Any, final

import numpy as np
import torch
from jaxtyping import Float, Float32
from torch import Tensor

from semgs.data.frames import Frame, undistortion
from semgs.data.maps import MILLIMETRE, fit_to_image, known_depths
from semgs.data.resampling import Fit, kept_window, nearest
from semgs.data.scene import Scene
from semgs.depth_maps.depth_source import DepthMaps, Meaning
from semgs.files.arrays import without_channel
from semgs.files.errors import InputError, needs_extra
from semgs.files.images.pictures import MOST_PIXELS, TIFFS, read_tiff, read_uint16
from semgs.files.records import make_record
from semgs.files.stored import stored
from semgs.files.strict_json import read_json
from semgs.sources.photo_maps import needed_file, only_array, scene_folder, stems_of

RECORD = "depth.json"
COUNTED = (".png", *TIFFS)
ENDINGS = (".npy", ".npz", ".exr", *COUNTED)
CHANNELS = ("Z", "Y", "R")
DEPTH_OF_LAYERS = (".Z", ".Depth.V")
"""How the channel of depth is called in files of several layers, as Blender writes them."""

MOST_NUMBERS = 4 * MOST_PIXELS
"""OpenEXR files with more numbers in all their channels are not read."""


@dataclass(frozen=True)
class MapRecord:
    """What `depth.json` says.

    Attributes:
        meaning: of the numbers.
        unit: metres per number, if they are metric; None for metres, and millimetres in PNG and TIFF files of 16 bits.
        licence: of the maps, or of the network that predicted them.
    """

    meaning: Meaning
    unit: float | None = None
    licence: str = "unknown"

    def __post_init__(self) -> None:
        if self.unit is not None and not (self.meaning == "metric" and self.unit > 0):
            raise ValueError(f"unit is {self.unit}; expected a positive number, with metric maps only")


@final
@dataclass(frozen=True)
class MapFolder(DepthMaps):
    """A folder of depth maps for the frames of a scene.

    Attributes:
        folder: contains them.
        record: what they mean.
        stems: how many frames of the scene have each file name, without folders and ending.
    """

    folder: Path
    record: MapRecord
    stems: Counter[str]

    @property
    def title(self) -> str:
        """The folder, and its licence if that is known."""
        known = "" if self.record.licence == "unknown" else f" (licence {self.record.licence})"
        return f"{self.folder}{known}"

    @property
    def meaning(self) -> Meaning:
        """What the numbers are."""
        return self.record.meaning

    def of(self, frame: Frame, size: tuple[int, int], fit: Fit = "crop") -> Float[Tensor, "h w"]:
        """As `DepthMaps.of`; values are never interpolated.

        Raises:
            InputError: as `DepthMaps.of`, or the map has another aspect than the photo.
        """
        path = needed_file(self.folder, frame, self.stems, ENDINGS, "a depth map")
        values = fit_to_image(stored(path), self._values(path), frame.lens.size)
        lens_maps = undistortion(frame.lens)
        if lens_maps is not None:
            values = frame.lens.undistorted(values, lens_maps, nearest=True)
        top, left, height, width = kept_window(frame.lens.size, size, fit)
        return nearest(torch.from_numpy(values)[top : top + height, left : left + width], size)

    def _values(self, path: Path) -> Float32[np.ndarray, "rows columns"]:
        """The numbers in a file, in metres if they are metric; NaN where unknown."""
        if path.suffix in COUNTED:
            values = read_uint16(path) if path.suffix == ".png" else read_tiff(path)
        else:
            expected = "one array of numbers [height width]"
            values = _read_exr(path) if path.suffix == ".exr" else only_array(path, expected)
            values = without_channel(values)
            if values.ndim != 2 or min(values.shape) < 1:
                raise InputError(path, expected, f"{values.shape}")
        unit = self.record.unit
        if unit is None:
            unit = MILLIMETRE if path.suffix in COUNTED and values.dtype == np.uint16 else 1.0
        factor = unit if self.meaning == "metric" else 1.0
        numbers = values.astype(np.float32) * np.float32(factor)
        is_depth = self.meaning != "inverse" or values.dtype == np.uint16
        return np.where(known_depths(values) if is_depth else np.isfinite(numbers), numbers, np.float32(np.nan))


def open_map_folder(folder: Path, scene: Scene, meaning: Meaning | None) -> MapFolder:
    """The maps in a folder, for the frames of a scene.

    Args:
        folder: contains them, or a folder for each scene by its name.
        scene: contains the frames.
        meaning: what the numbers are; None for what `depth.json` says.

    Raises:
        InputError: `depth.json` is damaged, or neither it nor `meaning` says what the numbers are.
    """
    own = scene_folder(folder, scene)
    path = next((place / RECORD for place in (own, folder) if (place / RECORD).is_file()), None)
    record = None if path is None else _read_record(path)
    if meaning is not None:
        same = record is not None and record.meaning == meaning
        record = record if same else MapRecord(meaning, licence=record.licence if record else "unknown")
    if record is None:
        advice = f'give --depth-meaning metric, scaled or inverse, or write {{"meaning": "scaled"}} to {RECORD}'
        raise InputError(folder, f"{RECORD}, which says what the numbers mean", "none", advice=advice)
    return MapFolder(own, record, stems_of(scene))


def _read_record(path: Path) -> MapRecord:
    """What a `depth.json` says.

    Raises:
        InputError: it is damaged.
    """
    content: Any = read_json(path, "what depth maps mean")
    try:
        return make_record(MapRecord, content)
    except ValueError as error:
        raise InputError(path, "what depth maps mean", str(error), advice="see docs/segmenters.md") from error


def _read_exr(path: Path) -> Float32[np.ndarray, "rows columns"]:
    """The depth channel of an OpenEXR file.

    Raises:
        InputError: it is damaged, or has several channels and none of the usual names.
        ImportError: OpenEXR is not installed; the message names the extra.
    """
    with needs_extra("exr", f"{path} is an OpenEXR file", "OpenEXR"):
        import OpenEXR
    try:
        numbers = sum(_numbers_in(part.header) for part in OpenEXR.File(str(path), header_only=True).parts)
        if numbers > MOST_NUMBERS:
            raise InputError(path, f"an image of at most {MOST_NUMBERS:,} numbers", f"{numbers:,}")
        channels = OpenEXR.File(str(path), separate_channels=True).channels()
        names = [name for name in CHANNELS if name in channels] or (list(channels) if len(channels) == 1 else [])
        names = names or sorted(name for name in channels if name.endswith(DEPTH_OF_LAYERS))
        if not names or (len(names) > 1 and names[0] not in CHANNELS):
            expected = f"a channel {', '.join(CHANNELS)}, or one that ends in {' or '.join(DEPTH_OF_LAYERS)}"
            raise InputError(path, expected, ", ".join(sorted(channels)) or "none")
        return np.asarray(channels[names[0]].pixels, np.float32)
    except InputError:
        raise
    except (RuntimeError, ValueError, TypeError) as error:
        raise InputError(path, "an OpenEXR image", (str(error).splitlines() or ["a damaged one"])[0]) from error


def _numbers_in(header: dict[str, Any]) -> int:
    """How many numbers of all channels an OpenEXR file says that it has: all of them are read."""
    low, high = (np.asarray(corner, np.int64) for corner in header["dataWindow"])
    width, height = (high - low + 1).tolist()
    return max(0, width) * max(0, height) * max(1, len(header["channels"]))
