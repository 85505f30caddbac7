"""TUM RGB-D: association by time, the order of its quaternions, and its pixels."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from miniatures import Miniature, back_projected, check_projection, check_read, miniature, quaternion, write_picture

from semgs.data.layouts.parts.trajectories import associate, in_seconds
from semgs.data.scenes import open_scene
from semgs.files.errors import InputError
from semgs.files.images.pictures import write_tiff

START = 1311868164.363181


def write_tum(
    folder: Path, room: Miniature, *, end: str = "\n", calibration: str | None = "32.5 31.0 30.5 24.5"
) -> Path:
    """A recording whose depth is 4 ms late and whose poses come at three times the rate of its pictures, 1 ms early."""
    times = START + np.arange(len(room)) / 30
    for index, time in enumerate(times):
        write_picture(folder / f"rgb/{time:.6f}.png", room.images[index])
        write_picture(
            folder / f"depth/{time + 0.004:.6f}.png",
            (5 * room.depths[index].astype(int)).clip(0, 65534).astype(np.uint16),
        )
    lists = {
        "rgb": [f"{time:.6f} rgb/{time:.6f}.png" for time in times],
        "depth": [f"{time + 0.004:.6f} depth/{time + 0.004:.6f}.png" for time in times],
        "groundtruth": [],
    }
    for index, time in enumerate(times):
        for shift in (-1 / 90, 0, 1 / 90):  # the pose that belongs to a picture stands between two that do not
            pose = room.poses[index] if shift == 0 else room.poses[(index + 1) % len(room)]
            numbers = " ".join(f"{value:.10f}" for value in (*pose[:3, 3], *quaternion(pose[:3, :3])))
            lists["groundtruth"].append(f"{time - 0.001 + shift:.6f} {numbers}")
    for name, held in lists.items():
        text = end.join(["# timestamp and more", "# file: 'rgbd_dataset.bag'", *held, ""])
        (folder / f"{name}.txt").write_bytes(text.encode())
    if calibration is not None:
        (folder / "calibration.txt").write_text(calibration)
    return folder


@pytest.mark.parametrize("end", ["\n", "\r\n"])
def test_what_is_read_equals_what_was_written(tmp_path: Path, end: str):
    room = miniature()
    check_read(open_scene(write_tum(tmp_path / "my room", room, end=end)), room)


def test_a_point_is_where_the_benchmarks_formula_puts_it(tmp_path: Path):
    room = miniature()
    scene = open_scene(write_tum(tmp_path, room))
    depth = room.depths[2, 30, 50] / 1000
    check_projection(
        scene, 2, back_projected(room.poses[2], (32.5, 31.0), (30.5, 24.5), (30, 50), depth), (30, 50), depth
    )


def test_depth_in_floating_point_tiff_is_in_metres(tmp_path: Path):
    room = miniature()
    folder = write_tum(tmp_path, room)
    for file, depths in zip(sorted((folder / "depth").iterdir()), room.depths, strict=True):
        write_tiff(file.with_suffix(".tiff"), depths / 1000)
        file.unlink()
    (folder / "depth.txt").write_text((folder / "depth.txt").read_text().replace(".png", ".tiff"))
    check_read(open_scene(folder), room)


def test_without_a_calibration_the_drivers_defaults_are_taken_and_told(tmp_path: Path):
    scene = open_scene(write_tum(tmp_path, miniature((480, 640), 2), calibration=None))
    assert scene.frames[0].lens.focal == (525, 525)
    assert scene.frames[0].lens.centre == (320, 240)
    assert "drivers' defaults" in scene.notes[0]
    assert scene.unit == "metric"


def test_resized_recordings_have_the_defaults_resized_and_others_need_intrinsics(tmp_path: Path):
    lens = open_scene(write_tum(tmp_path / "half", miniature((120, 160), 2), calibration=None)).frames[0].lens
    assert (*lens.focal, *lens.centre) == (131.25, 131.25, 80, 60)
    wide = write_tum(tmp_path / "wide", miniature((45, 80), 2), calibration=None)
    with pytest.raises(InputError, match=r"intrinsics for 80x45 .* found some for 640x480; .*--intrinsics fx fy cx cy"):
        open_scene(wide)
    assert open_scene(wide, intrinsics=(70.0, 71.0, 40.0, 22.0)).frames[1].lens.focal == (70, 71)


def test_association_takes_the_nearest_first_and_each_once():
    first, second = np.array([0.0, 1.0, 2.0, 3.0]), np.array([3.019, 1.015, 0.99, 2.03, 0.995])
    assert associate(first, second) == {1: 4, 3: 0}
    assert associate(np.array([1.0, 1.01]), np.array([1.008])) == {1: 0}
    assert associate(np.array([1.0, 1.01, 1.02]), np.array([1.011, 1.012])) == {1: 0, 2: 1}


def test_frames_without_depth_or_pose_are_counted_and_work_goes_on(tmp_path: Path):
    room = miniature()
    folder = write_tum(tmp_path, room)
    depths = (folder / "depth.txt").read_text().splitlines(keepends=True)
    (folder / "depth.txt").write_text("".join(depths[:4] + depths[5:]))
    poses = [line for line in (folder / "groundtruth.txt").read_text().splitlines() if not line.startswith("#")]
    poses[-2] = poses[-2].split()[0] + " nan nan nan -1.#IND 0 0 1"
    (folder / "groundtruth.txt").write_text("\n".join(poses[3:]))
    (folder / "rgb.txt").write_text((folder / "rgb.txt").read_text() + "1311868199.0 rgb/late.png\n")
    scene = open_scene(folder)
    assert [frame.depth is None for frame in scene.frames] == [False, True, False, False, False, False]
    assert [note.split(",")[0] for note in scene.notes] == [
        "1 of 9 frames have no finite pose and are left out",
        "2 of 9 frames have no pose and are left out",
        "1 of 9 frames have no depth map",
    ]
    check_read(scene, room, list(range(1, 7)), depths=False)


def test_what_cannot_be_read_is_refused_with_file_and_line(tmp_path: Path):
    folder = write_tum(tmp_path, miniature(frames=3))
    poses = (folder / "groundtruth.txt").read_text()
    (folder / "groundtruth.txt").write_text(poses.replace(" -", " x-", 1))
    with pytest.raises(InputError, match=r"groundtruth\.txt: line \d+: expected numbers"):
        open_scene(folder)
    (folder / "groundtruth.txt").write_text("# nothing yet\n")
    with pytest.raises(InputError, match=r"groundtruth\.txt: expected poses .* found no line with numbers"):
        open_scene(folder)
    (folder / "groundtruth.txt").write_text("12.5 0 0 0 0 0 0 1\n")
    with pytest.raises(
        InputError, match=r"times: expected images and poses at the same times, found images from 13118"
    ):
        open_scene(folder)
    (folder / "groundtruth.txt").unlink()
    with pytest.raises(InputError, match=r"groundtruth\.txt: expected the poses of the camera"):
        open_scene(folder)
    (folder / "rgb.txt").write_text("")
    (folder / "groundtruth.txt").write_text(poses)
    with pytest.raises(InputError, match=r"rgb\.txt: expected lines of a time and a file, found none"):
        open_scene(folder)


@pytest.mark.parametrize("factor", [1e3, 1e6, 1e9])
@pytest.mark.parametrize("names", [("groundtruth",), ("rgb", "depth"), ("rgb", "depth", "groundtruth")])
def test_times_in_parts_of_a_second_are_those_in_seconds(tmp_path: Path, names: tuple[str, ...], factor: float):
    """The clock of 2011 is 1.3e9 s, 1.3e12 ms, 1.3e15 us, 1.3e18 ns."""
    room = miniature()
    folder = write_tum(tmp_path / "room", room)
    for name in names:
        lines = [line.split(" ", 1) for line in (folder / f"{name}.txt").read_text().splitlines() if line[0] != "#"]
        text = "".join(f"{round(float(time) * factor)} {rest}\n" for time, rest in lines)
        (folder / f"{name}.txt").write_text(text)
    check_read(open_scene(folder), room)


def test_poses_named_as_in_euroc_and_tum_vi_are_the_same(tmp_path: Path):
    """Nanoseconds since the start, so that their size does not show the unit; w comes first."""
    room = miniature()
    folder = write_tum(tmp_path / "room", room)
    for name in ("rgb", "depth", "groundtruth"):
        lines = [line.split() for line in (folder / f"{name}.txt").read_text().splitlines() if line[0] != "#"]
        rows = [[str(round((float(time) - START) * 1e9)), *rest] for time, *rest in lines]
        title = "#timestamp [ns],filename"
        if name == "groundtruth":
            rows = [[time, x, y, z, qw, qx, qy, qz] for time, x, y, z, qx, qy, qz, qw in rows]
            title = "#timestamp [ns],p_RS_R_x [m],p_RS_R_y [m],p_RS_R_z [m],q_RS_w [],q_RS_x [],q_RS_y [],q_RS_z []"
        (folder / f"{name}.txt").write_text("".join(f"{','.join(row)}\n" for row in [[title], *rows]))
    scene = open_scene(folder)
    check_read(scene, room)
    assert [note.split(".")[0] for note in scene.notes] == ["Poses in groundtruth"]
    assert scene.notes[0].endswith("whose poses are the IMU's: if so, multiply them by T_BS of the camera.")


def test_only_times_that_no_clock_shows_in_seconds_are_in_smaller_units():
    for times in ([0.0, 0.5], [1.3e9, 1.4e9], [np.nan, 3.0], []):
        np.testing.assert_array_equal(in_seconds(np.array(times)), times)
    np.testing.assert_array_equal(in_seconds(np.array([np.nan, 1.3e12])), [np.nan, 1.3e9])
