"""What recordings have in common: files by number, text as any system writes it, and names of scenes."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from semgs.data.layouts.parts.text_numbers import read_lines, read_rows
from semgs.data.layouts.parts.trajectories import poses_from_quaternions, read_pose, read_trajectory
from semgs.data.layouts.parts.usable_frames import numbered_files, sequence_name
from semgs.files.errors import InputError


def test_files_are_in_the_order_of_their_numbers(tmp_path: Path):
    for name in ("rgb_10.png", "rgb_2.png", "RGB_0003.PNG", "rgb_2.jpg", "rgb_x.png", "depth_1.png", "rgb_1.png.part"):
        (tmp_path / name).touch()
    found = numbered_files(tmp_path, "rgb_", (".png", ".jpg"))
    assert {number: path.name for number, path in found.items()} == {
        2: "rgb_2.png",
        3: "RGB_0003.PNG",
        10: "rgb_10.png",
    }
    assert list(found) == [2, 3, 10]
    assert numbered_files(tmp_path / "nowhere") == {}


@pytest.mark.parametrize(
    "word", ["-1.#IND", "1.#QNAN", "-1.#INF", "1.#INF00", "1.#IND000e+000", "-1.#INF000E+000", "1.#QNAN0e+000", "1.#J"]
)
def test_what_microsoft_prints_for_nan_and_infinity_is_not_finite(tmp_path: Path, word: str):
    path = tmp_path / "numbers.txt"
    path.write_text(f"1.5 {word}\t-2\n")
    np.testing.assert_array_equal(read_rows(path)[0][1], [1.5, np.nan, -2])


def test_numbers_are_read_however_they_are_set(tmp_path: Path):
    path = tmp_path / "numbers.txt"
    path.write_bytes(
        b"\xef\xbb\xbf# pose\r\n1,2;3\t4\r\n\r\n[ -1e-3, nan, -nan(ind), 1.#QNAN ]\r\n-inf -1.#IND Infinity 5\r\n"
    )
    assert read_lines(path)[0] == (2, "1,2;3\t4")
    held = read_rows(path)
    assert [number for number, _ in held] == [2, 4, 5]
    np.testing.assert_array_equal(
        [values for _, values in held],
        [[1, 2, 3, 4], [-0.001, np.nan, np.nan, np.nan], [np.nan, np.nan, np.nan, 5]],
    )
    for content, message in (
        (b"1 two 3", "line 1: expected numbers"),
        (b"1 1.# 3", "line 1: expected numbers"),
        (b"1 1.#INF0e 3", "line 1: expected numbers"),
        (b"1 2.#INF 3", "line 1: expected numbers"),
        (b"\xff\xfe1", "byte 0, which is not UTF-8"),
        (b"1\0", "zero bytes"),
    ):
        path.write_bytes(content)
        with pytest.raises(InputError, match=message):
            read_rows(path)
    with pytest.raises(InputError, match="a text file in UTF-8, found No such file"):
        read_rows(tmp_path / "nowhere.txt")


@pytest.mark.parametrize("rows_of", [(4, 4, 4), (4, 4, 4, 4), (12,), (16,), (8, 8)])
def test_a_pose_may_be_3x4_or_4x4_in_one_line_or_more(tmp_path: Path, rows_of: tuple[int, ...]):
    numbers = iter([*range(12), 0, 0, 0, 1])
    path = tmp_path / "pose.txt"
    path.write_text("\n".join(" ".join(str(next(numbers)) for _ in range(count)) for count in rows_of))
    if rows_of == (8, 8):
        with pytest.raises(InputError, match=r"4x4 or 3x4 numbers, .* found 2 lines of \[8\] numbers"):
            read_pose(path)
    else:
        np.testing.assert_array_equal(
            read_pose(path).matrix, [[0, 1, 2, 3], [4, 5, 6, 7], [8, 9, 10, 11], [0, 0, 0, 1]]
        )


def test_a_quarter_turn_about_each_axis_is_what_the_formula_says():
    half = 0.5**0.5
    poses = poses_from_quaternions(
        np.zeros((4, 3)), np.array([[half, 0, 0, half], [0, 2, 0, 2], [0, 0, half, half], [0, 0, 0, 0]])
    )
    np.testing.assert_allclose(poses[0, :3, :3], [[1, 0, 0], [0, 0, -1], [0, 1, 0]], atol=1e-15)
    np.testing.assert_allclose(poses[1, :3, :3], [[0, 0, 1], [0, 1, 0], [-1, 0, 0]], atol=1e-15)
    np.testing.assert_allclose(poses[2, :3, :3], [[0, -1, 0], [1, 0, 0], [0, 0, 1]], atol=1e-15)
    assert np.isnan(poses[3, :3, :3]).all()


def test_matrices_below_each_other_are_told_apart_by_their_last_row(tmp_path: Path):
    three, four = np.arange(12.0).reshape(3, 4), np.vstack((np.arange(12.0).reshape(3, 4), [0, 0, 0, 1]))
    for stack, count in ((np.vstack([three] * 4), 4), (np.vstack([four] * 3), 3)):
        np.savetxt(tmp_path / "all.txt", stack)
        poses = read_trajectory(tmp_path / "all.txt").poses
        assert len(poses) == count
        np.testing.assert_array_equal(poses[-1], four)


@pytest.mark.parametrize(
    ("path", "name"),
    [
        ("chess/seq-01", "chess_seq-01"),
        ("office_0/Sequence_2", "office_0_Sequence_2"),
        ("a/my room", "my room"),
        ("room_1/imap/00", "room_1_imap_00"),
    ],
)
def test_sequences_are_called_after_their_scene(tmp_path: Path, path: str, name: str):
    assert sequence_name(tmp_path / path) == name
