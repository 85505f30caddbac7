"""Sparse points in a PLY in text, as nerfstudio writes them beside its `transforms.json` (`ply_file_path`)."""

from __future__ import annotations

import numpy as np

from semgs.data.cameras.lens import Lens
from semgs.data.frames import Frame
from semgs.files.contents import read_bytes
from semgs.files.errors import InputError
from semgs.files.stored import Stored

MOST = 50_000
"""Of more points, every n-th is used: enough for near and far."""


def read_ply_points(file: Stored) -> np.ndarray | None:
    """The positions [n 3] of the points; None if it is another kind of PLY.

    Raises:
        InputError: the file is damaged.
    """
    head, _, body = read_bytes(file, "sparse points").partition(b"end_header\n")
    lines = [line.split() for line in head.splitlines()]
    names = [line[2] for line in lines if line[:1] == [b"property"] and len(line) == 3]
    elements = [line[1:] for line in lines if line[:1] == [b"element"]]
    if [b"format", b"ascii", b"1.0"] not in lines or names[:3] != [b"x", b"y", b"z"] or len(elements) != 1:
        return None
    rows = body.splitlines()
    try:
        points = np.array([row.split()[:3] for row in rows[:: 1 + len(rows) // MOST]], dtype=np.float64).reshape(-1, 3)
    except ValueError as error:
        raise InputError(file, "three numbers at the beginning of each line", str(error)) from error
    if str(len(rows)).encode() != elements[0][1] or not np.isfinite(points).all():
        raise InputError(file, f"{elements[0][1].decode()} points of finite numbers", f"{len(rows)} lines")
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
