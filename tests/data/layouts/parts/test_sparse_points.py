"""Sparse points beside a transforms.json."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from semgs.data.cameras.lens import Lens
from semgs.data.frames import Frame
from semgs.data.layouts.parts.sparse_points import points_in_view, read_ply_points
from semgs.files.errors import InputError

HEAD = "ply\nformat ascii 1.0\nelement vertex 2\nproperty float x\nproperty float y\nproperty float z\nproperty uint8 red\nend_header\n"


def test_positions_are_read_and_colours_skipped(tmp_path: Path):
    (tmp_path / "a.ply").write_text(HEAD + "1 2 3 255\n-4.5 5e1 6 0\n")
    np.testing.assert_array_equal(read_ply_points(tmp_path / "a.ply"), [[1, 2, 3], [-4.5, 50, 6]])


@pytest.mark.parametrize("body", ["1 2 3 255\n", "1 2 3 255\n1 nan 3 0\n", "1 2 3 0\na b c 0\n"])
def test_damaged_points_are_refused(tmp_path: Path, body: str):
    (tmp_path / "a.ply").write_text(HEAD + body)
    with pytest.raises(InputError, match=r"a\.ply"):
        read_ply_points(tmp_path / "a.ply")


def test_a_binary_file_is_left_out(tmp_path: Path):
    (tmp_path / "a.ply").write_text(HEAD.replace("ascii", "binary_little_endian") + "\0\0")
    assert read_ply_points(tmp_path / "a.ply") is None


def test_points_in_view_are_those_in_front_and_inside():
    # At (1, 0, 0), looking along the world's x axis with y down: the camera's x axis is -z.
    pose = np.array([[0.0, 0, 1, 1], [0, 1, 0, 0], [-1, 0, 0, 0], [0, 0, 0, 1]])
    frame = Frame("a", Path("a.png"), Lens((80, 100), (100.0, 100.0), (30.0, 40.0), (0.0,) * 5), pose)
    points = np.array([
        [3, 0, 0],  # depth 2, column 30
        [3, 0, -1.3],  # column 30 + 65 = 95
        [3, 0, -1.5],  # column 105, outside of 100
        [3, 0, 0.7],  # column 30 - 35 = -5, outside
        [3, 0.7, 0],  # row 75
        [3, 0.9, 0],  # row 85, outside of 80
        [-1, 0, 0],  # behind
    ])  # fmt: skip
    assert points_in_view(frame, points).tolist() == [0, 1, 4]
