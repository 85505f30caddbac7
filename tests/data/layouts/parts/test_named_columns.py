"""Poses whose columns a comment names: w first or last, other columns between, and the unit of the time."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from semgs.data.layouts.parts.text_numbers import times_per_second
from semgs.data.layouts.parts.trajectories import Trajectory, read_pose, read_trajectory
from semgs.files.errors import InputError

TURNED = np.array([[1, 0, 0, 1], [0, 0.28, -0.96, 2], [0, 0.96, 0.28, 3], [0, 0, 0, 1]])
"""w = 0.8 and x = 0.6 turn about x: the cosine is 0.8^2 - 0.6^2 = 0.28, the sine 2 * 0.8 * 0.6 = 0.96."""

EUROC = (
    "#timestamp [ns], p_RS_R_x [m], p_RS_R_y [m], p_RS_R_z [m], q_RS_w [], q_RS_x [], q_RS_y [], q_RS_z [], "
    "v_RS_R_x [m s^-1], v_RS_R_y [m s^-1], v_RS_R_z [m s^-1]\n"
)


def trajectory(folder: Path, text: str) -> Trajectory:
    (folder / "poses.txt").write_text(text)
    return read_trajectory(folder / "poses.txt")


@pytest.mark.parametrize(
    "text",
    [
        "# time tx ty tz qw qx qy qz\n7 1 2 3 0.8 0.6 0 0\n",
        "# poses of a hand\n#timestamp [s],p_x [m],p_y [m],p_z [m],q_w [],q_x [],q_y [],q_z []\n7,1,2,3,0.8,0.6,0,0\n",
        "# q_z, q_y, q_x, q_w, position.z, position.y, position.x, stamp\n0, 0, 0.6, 0.8, 3, 2, 1, 7\n",
        "# each line: timestamp tx ty tz qw qx qy qz (of the camera) in the world\n7 1 2 3 0.8 0.6 0 0\n",
        EUROC + "7000000000,1,2,3,0.8,0.6,0,0,0.1,0.2,0.3\n",
        "# timestamp_us x y z rot_w rot_x rot_y rot_z\n7000000 1 2 3 0.8 0.6 0 0\n",
        "# format: time x y z qx qy qz qw, in metres and seconds of the clock\n7 1 2 3 0.6 0 0 0.8\n",
        "7 1 2 3 0.6 0 0 0.8\n",
    ],
)
def test_columns_are_read_by_their_names(tmp_path: Path, text: str):
    found = trajectory(tmp_path, text)
    np.testing.assert_allclose(found.poses, TURNED[None], atol=1e-12)
    assert found.times is not None
    assert found.times.tolist() == [7.0]


def test_lines_without_time_and_files_of_one_pose_are_read_by_names_too(tmp_path: Path):
    found = trajectory(tmp_path, "# qw qx qy qz tx ty tz\n0.8 0.6 0 0 1 2 3\n")
    assert found.times is None
    np.testing.assert_allclose(found.poses[0], TURNED, atol=1e-12)
    np.testing.assert_allclose(read_pose(tmp_path / "poses.txt").matrix, TURNED, atol=1e-12)


def test_ids_of_frames_are_read(tmp_path: Path):
    found = trajectory(tmp_path, "#timestamp x y z qx qy qz qw id\n7.5 1 2 3 0.6 0 0 0.8 12\n8.5 1 2 3 0.6 0 0 0.8 4\n")
    assert found.ids == (12, 4)
    np.testing.assert_allclose(found.poses[1], TURNED, atol=1e-12)


@pytest.mark.parametrize(
    "names",
    [
        "time tx ty tz q1 q2 q3 q4",
        "time tx ty tz qx qy qz",
        "time x y z roll pitch yaw w",
        "time tx ty tz flag qw qx qy qz",
        "time tx ty tz qx qx qy qz",
    ],
)
def test_names_that_are_not_understood_are_refused_with_their_line(tmp_path: Path, names: str):
    with pytest.raises(
        InputError, match=r"poses\.txt: line 2: expected columns named time, x, y, z, .*found 'time "
    ) as caught:
        trajectory(tmp_path, f"# made by hand\n# {names}\n7 1 2 3 0.8 0.6 0 0\n")
    assert "above lines of 8 numbers; correct the names, or remove the comment" in str(caught.value)


def test_names_above_matrices_change_nothing(tmp_path: Path):
    text = "# r00 r01 r02 tx r10 r11 r12 ty r20 r21 r22 tz\n" + " ".join(map(str, TURNED[:3].ravel())) + "\n"
    np.testing.assert_array_equal(trajectory(tmp_path, text).poses[0], TURNED)


def test_only_a_stated_unit_is_known(tmp_path: Path):
    for line, expected in (
        ("timestamp [ns],filename", 1e9),
        ("timestamp (ms) filename", 1e3),
        ("timestamp filename", None),
        ("timestamp, terms of use", None),
    ):
        (tmp_path / "rgb.txt").write_text(f"# {line}\n5 a.png\n")
        assert times_per_second(tmp_path / "rgb.txt") == expected
