"""Sparse points in a PLY, as nerfstudio writes them beside its `transforms.json` (`ply_file_path`)."""

from __future__ import annotations

import numpy as np

from semgs.data.cameras.lens import Lens
from semgs.data.frames import Frame
from semgs.data.ply_tables import read_tables
from semgs.files.contents import read_bytes
from semgs.files.errors import InputError
from semgs.files.stored import Stored

AXES = ("x", "y", "z")
MOST = 50_000
"""Of more points, every n-th is used: enough for near and far."""


def read_ply_points(file: Stored) -> np.ndarray:
    """The positions [n 3] of the points: of a PLY in text or binary, with or without colours, normals and faces.

    Raises:
        InputError: it is something else, or damaged.
    """
    columns = read_tables(file, read_bytes(file, "sparse points"), last="vertex").tables["vertex"]
    missing = [name for name in AXES if name not in columns]
    if missing:
        raise InputError(file, "points with x, y and z", f"properties {', '.join(columns) or '(none)'}", "header")
    step = 1 + len(columns["x"]) // MOST
    points = np.stack([columns[name][::step] for name in AXES], axis=1).astype(np.float64)
    if not np.isfinite(points).all():
        raise InputError(file, "points of finite numbers", "others")
    return points


def points_in_view(frame: Frame, points: np.ndarray) -> np.ndarray:
    """The indices of the points that project into a frame's image, whether or not something hides them."""
    assert isinstance(frame.lens, Lens)
    pose, (height, width) = frame.world_from_camera, frame.lens.size
    x, y, depth = ((points - pose[:3, 3]) @ pose[:3, :3]).T
    with np.errstate(divide="ignore", invalid="ignore"):
        column = frame.lens.focal[0] * x / depth + frame.lens.centre[0]
        row = frame.lens.focal[1] * y / depth + frame.lens.centre[1]
    return np.flatnonzero((depth > 0) & (column >= 0) & (column < width) & (row >= 0) & (row < height))
