"""Files of occupancy: a map for ROS's map_server, and voxels with classes.

`map.pgm` and `map.yaml` are what map_server (ROS 1 and Nav2) reads in its mode "trinary" without "negate": with p = (255 - pixel) / 255, a cell is occupied if
p > 0.65, free if p < 0.196, and unknown otherwise. 205 gives p = 0.19608, so a free_thresh of 0.25, which other files have, would read unknown as free. The
first row of the image is the one with the largest y.

`voxels.npz` has `voxels` [z y x] (-1 unknown, 0 free, 100 occupied), `labels` [z y x] (255 for none), `origin` (the corner of the first voxel),
`resolution`, `floor` (its height) and `classes` (names in the order of the labels).
"""

from __future__ import annotations

import io
from pathlib import Path

import numpy as np
from jaxtyping import Int8

from semgs.data.tables.classes import ClassTable
from semgs.files.atomic import write_bytes, write_text
from semgs.robotics.occupancy import FREE, OCCUPIED, Occupancy

IMAGE, SETTINGS, VOXELS = "map.pgm", "map.yaml", "voxels.npz"

PIXELS = {OCCUPIED: 0, FREE: 254}
"""Grey of cells; unknown ones have `UNKNOWN_PIXEL`."""

UNKNOWN_PIXEL = 205

OCCUPIED_ABOVE, FREE_BELOW = 0.65, 0.196
"""The thresholds of map_server."""


def save_map(folder: Path, found: Occupancy) -> None:
    """Write map.pgm and map.yaml.

    Args:
        folder: for both.
        found: in the frame of the map, with z up.

    Raises:
        OSError: a file cannot be written.
    """
    x, y, _ = found.origin
    write_bytes(folder / IMAGE, map_image(found.cells))
    lines = (
        f"image: {IMAGE}",
        "mode: trinary",
        f"resolution: {found.resolution!r}",
        f"origin: [{x:.6f}, {y:.6f}, 0.0]",
        "negate: 0",
        f"occupied_thresh: {OCCUPIED_ABOVE}",
        f"free_thresh: {FREE_BELOW}",
    )
    write_text(folder / SETTINGS, "\n".join(lines) + "\n")


def map_image(cells: Int8[np.ndarray, "y x"]) -> bytes:
    """The binary PGM of a plan."""
    grey = np.full(cells.shape, UNKNOWN_PIXEL, np.uint8)
    for content, pixel in PIXELS.items():
        grey[cells == content] = pixel
    height, width = cells.shape
    return b"P5\n%d %d\n255\n" % (width, height) + grey[::-1].tobytes()


def save_voxels(folder: Path, found: Occupancy, classes: ClassTable | None) -> None:
    """Write voxels.npz.

    Args:
        folder: for the file.
        found: in the frame of the file, with z up.
        classes: the table of the labels.

    Raises:
        OSError: the file cannot be written.
    """
    file = io.BytesIO()
    np.savez_compressed(
        file,
        voxels=found.voxels,
        labels=found.labels,
        origin=np.array(found.origin),
        resolution=np.array(found.resolution),
        floor=np.array(found.floor),
        classes=np.array(() if classes is None else classes.names, dtype=np.str_),
    )
    write_bytes(folder / VOXELS, file.getvalue())
