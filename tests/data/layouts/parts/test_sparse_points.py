"""Sparse points beside a transforms.json."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from semgs.data.cameras.lens import Lens
from semgs.data.frames import Frame
from semgs.data.layouts.parts import sparse_points
from semgs.data.layouts.parts.sparse_points import points_in_view, read_ply_points
from semgs.files.errors import InputError

HEAD = "ply\nformat ascii 1.0\nelement vertex 2\nproperty float x\nproperty float y\nproperty float z\nproperty uint8 red\nend_header\n"


def test_positions_are_read_and_colours_skipped(tmp_path: Path):
    (tmp_path / "a.ply").write_text(HEAD + "1 2 3 255\n-4.5 5e1 6 0\n")
    np.testing.assert_array_equal(read_ply_points(tmp_path / "a.ply"), [[1, 2, 3], [-4.5, 50, 6]])


def test_a_comment_may_be_in_any_encoding(tmp_path: Path):
    head = HEAD.encode().replace(b"ply\n", b"ply\ncomment B\xfcro\n")
    (tmp_path / "a.ply").write_bytes(head + b"1 2 3 255\n-4.5 5e1 6 0\n")
    np.testing.assert_array_equal(read_ply_points(tmp_path / "a.ply"), [[1, 2, 3], [-4.5, 50, 6]])


@pytest.mark.parametrize("body", ["1 2 3 255\n", "1 2 3 255\n1 nan 3 0\n", "1 2 3 0\na b c 0\n", "1 2 3 0\n1 2\n"])
def test_damaged_points_are_refused(tmp_path: Path, body: str):
    (tmp_path / "a.ply").write_text(HEAD + body)
    with pytest.raises(InputError, match=r"a\.ply"):
        read_ply_points(tmp_path / "a.ply")


FACES = "element face 1\nproperty list uchar int vertex_indices\n"


def of_properties(form: str, properties: str, more: str = "") -> str:
    """The header of two points."""
    lines = "".join(f"property {one}\n" for one in properties.split(", "))
    return f"ply\nformat {form} 1.0\ncomment by hand\nelement vertex 2\n{lines}{more}end_header\n"


@pytest.mark.parametrize(
    ("head", "body"),
    [
        (of_properties("ascii", "float x, float y, float z"), b"1 2 3\n-4.5 5e1 6\n\n"),
        (of_properties("ascii", "float x, float y, float z"), b"1 2 3\n-4.5 5e1 6"),
        (of_properties("ascii", "double z, uchar red, double x, double y"), b"3 9 1 2\n6 9 -4.5 50\n"),
        (of_properties("ascii", "float x, float y, float z", FACES), b"1 2 3\n-4.5 50 6\n3 0 1 1\n"),
        (of_properties("binary_little_endian", "float x, float y, float z, float nx"), np.array([[1, 2, 3, 0], [-4.5, 50, 6, 1]], "<f4").tobytes()),
        (of_properties("binary_big_endian", "double x, double y, double z"), np.array([[1, 2, 3], [-4.5, 50, 6]], ">f8").tobytes()),
        (
            of_properties("binary_little_endian", "float x, float y, float z", FACES),
            np.array([[1, 2, 3], [-4.5, 50, 6]], "<f4").tobytes() + b"\3" + np.array([0, 1, 1], "<i4").tobytes(),
        ),
    ],
    ids=["empty last line", "no last line end", "another order", "faces in text", "normals", "big endian", "faces"],
)  # fmt: skip
@pytest.mark.parametrize("ends", ["\n", "\r\n"])
def test_points_are_read_as_any_program_writes_them(tmp_path: Path, head: str, body: bytes, ends: str):
    text = body.replace(b"\n", ends.encode()) if "ascii" in head else body
    (tmp_path / "a.ply").write_bytes(head.replace("\n", ends).encode() + text)
    np.testing.assert_array_equal(read_ply_points(tmp_path / "a.ply"), [[1, 2, 3], [-4.5, 50, 6]])


@pytest.mark.parametrize(
    ("head", "message"),
    [
        (of_properties("ascii", "float x, float y"), "points with x, y and z, found properties x, y"),
        (of_properties("ascii", "float x").replace("vertex", "face"), "an element vertex, found face"),
        (of_properties("binary_little_endian", "float x, float y, float z"), "24 bytes after the header"),
        ("solid cube\n", "a PLY file, found no end of a header"),
    ],
)
def test_what_is_no_point_cloud_is_refused(tmp_path: Path, head: str, message: str):
    (tmp_path / "a.ply").write_text(head + "1 2\n3 4\n")
    with pytest.raises(InputError, match=message):
        read_ply_points(tmp_path / "a.ply")


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


def test_of_many_points_every_nth_is_used(tmp_path: Path, monkeypatch: pytest.MonkeyPatch):
    """Seven points with at most three: every third, from the first to the last part of the file."""
    monkeypatch.setattr(sparse_points, "MOST", 3)
    points = np.arange(21, dtype="<f4").reshape(7, 3)
    head = of_properties("binary_little_endian", "float x, float y, float z").replace("vertex 2", "vertex 7")
    (tmp_path / "a.ply").write_bytes(head.encode() + points.tobytes())
    np.testing.assert_array_equal(read_ply_points(tmp_path / "a.ply"), points[::3])
