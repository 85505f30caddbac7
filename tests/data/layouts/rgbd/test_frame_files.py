"""Frames in three files each: 7-Scenes with its two cameras, and those that bring their intrinsics."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from miniatures import Miniature, back_projected, check_projection, check_read, miniature, text, write_picture

from semgs.data.scenes import open_scene, open_scenes
from semgs.files.errors import InputError

K = "585 0 320\r\n0 590 235\r\n0 0 1\r\n"


def write_frames(folder: Path, room: Miniature, *, end: str = " \t\r\n", invalid: int = 65535) -> Path:
    """Frames as 7-Scenes has them: spaces before the end of each line, and unknown depth as the largest number."""
    for index in range(len(room)):
        stem = folder / f"frame-{index:06d}"
        write_picture(stem.with_suffix(".color.png"), room.images[index])
        depths = np.where(room.depths[index] == 0, invalid, room.depths[index]).astype(np.uint16)
        write_picture(stem.with_suffix(".depth.png"), depths)
        stem.with_suffix(".pose.txt").write_bytes(text(room.poses[index], end).encode())
    return folder


def with_intrinsics(folder: Path, room: Miniature) -> Path:
    """Such frames with 3DMatch's file of intrinsics."""
    write_frames(folder, room)
    (folder / "camera-intrinsics.txt").write_bytes(b" 57.5\t0\t31.5\r\n0 56.25 24.5\r\n0 0 1\r\n")
    return folder


def test_what_is_read_equals_what_was_written(tmp_path: Path):
    room = miniature()
    scene = open_scene(with_intrinsics(tmp_path / "red kitchen" / "seq-01", room))
    check_read(scene, room)
    assert scene.name == "red kitchen_seq-01"
    assert scene.unit == "metric"


def test_a_point_is_where_3dmatchs_formula_puts_it(tmp_path: Path):
    room = miniature()
    scene = open_scene(with_intrinsics(tmp_path, room))
    depth = room.depths[3, 40, 12] / 1000
    check_projection(
        scene, 3, back_projected(room.poses[3], (57.5, 56.25), (31.5, 24.5), (40, 12), depth), (40, 12), depth
    )


def test_7_scenes_has_colour_of_525_and_depth_of_585_about_the_same_middle(tmp_path: Path):
    room = miniature((480, 640), 2)
    scene = open_scene(write_frames(tmp_path / "seq-01", room))
    assert scene.frames[0].lens.focal == (525, 525)
    assert scene.frames[0].lens.centre == (320, 240)
    assert "depth is assumed to have 585 px, colour 525 px" in scene.notes[0]
    views = scene.read([0, 1], "native")
    np.testing.assert_allclose(views.cameras.world_from_camera.numpy(), room.poses, atol=1e-6)
    # A pixel of the depth map is met by the ray of colour that is 525/585 as far from the middle.
    for row, column in ((240, 320), (400, 600), (90, 300), (333, 47)):
        v, u = 240 + (row + 0.5 - 240) * 525 / 585, 320 + (column + 0.5 - 320) * 525 / 585
        around = room.depths[1, row - 1 : row + 2, column - 1 : column + 2] / 1000
        assert around.min() - 1e-3 <= float(views.depths[1, int(v), int(u)]) <= around.max() + 1e-3
    assert (views.depths[:, :, :32] == 0).all()  # colour sees further to the sides than depth does
    assert (views.depths[:, 300, 36] > 0).all()


def test_asked_for_the_depth_cameras_intrinsics_its_maps_come_as_they_are(tmp_path: Path):
    room = miniature((480, 640), 2)
    scene = open_scene(write_frames(tmp_path, room), intrinsics=(585.0, 585.0, 320.0, 240.0))
    check_read(scene, room)


def test_pictures_of_no_known_camera_need_intrinsics(tmp_path: Path):
    folder = write_frames(tmp_path, miniature((45, 80), 2))
    with pytest.raises(InputError, match=r"frame-000000\.color\.png: expected intrinsics for 80x45"):
        open_scene(folder)


def test_intrinsics_for_other_pictures_are_refused(tmp_path: Path):
    folder = write_frames(tmp_path / "seq-01", miniature(frames=2))
    (tmp_path / "camera-intrinsics.txt").write_text(K)
    with pytest.raises(InputError, match=r"camera-intrinsics\.txt: expected a principal point inside images of 64x48"):
        open_scene(folder)


def test_bundle_fusions_info_tells_intrinsics_size_and_unit(tmp_path: Path):
    room = miniature()
    folder = write_frames(tmp_path, room, end="\n", invalid=0)
    (folder / "info.txt").write_text(
        "m_versionNumber = 4\nm_sensorName = StructureSensor\nm_colorWidth = 64\nm_colorHeight = 48\nm_depthShift = 500\n"
        "m_calibrationColorIntrinsic = 58.3 0 32.1 0 0 58.4 23.9 0 0 0 1 0 0 0 0 1 \n"
    )
    scene = open_scene(folder)
    assert scene.frames[0].lens.focal == (58.3, 58.4)
    assert scene.frames[0].lens.centre == (32.6, 24.4)
    np.testing.assert_allclose(scene.read([1], "native").depths[0], room.depths[1] / 500, atol=1e-3)
    with (folder / "info.txt").open("a") as file:  # a depth camera that sees half as much
        file.write(
            "m_depthWidth = 64\nm_depthHeight = 48\nm_calibrationDepthIntrinsic = 116.6 0 31.5 0 0 116.8 23.5 0 0 0 1 0 0 0 0 1\n"
        )
    carried = open_scene(folder).read([1], "native").depths[0].numpy()
    assert (carried[:11] == 0).all()
    assert (carried[:, :16] == 0).all()
    # (32.5 - 32.6) / 58.3 * 116.6 + 32 = 31.8 and (24.5 - 24.4) / 58.4 * 116.8 + 24 = 24.2: column 31, row 24.
    assert carried[24, 32] == pytest.approx(room.depths[1, 24, 31] / 500, abs=1e-3)
    # Given intrinsics are those of the images: the depth camera and its 500 counts a metre stay. (48.5 - 32.4) / 233.2 * 116.6 + 32 = 40.05.
    given = open_scene(folder, intrinsics=(233.2, 233.6, 32.4, 24.4)).read([1], "native").depths[0].numpy()
    assert given[24, 48] == pytest.approx(room.depths[1, 24, 40] / 500, abs=1e-3)


def test_lost_poses_and_missing_files_are_counted(tmp_path: Path):
    room = miniature()
    folder = with_intrinsics(tmp_path, room)
    (folder / "frame-000002.pose.txt").write_text("-inf -inf -inf -inf\n" * 4)
    (folder / "frame-000003.pose.txt").unlink()
    (folder / "frame-000004.depth.png").unlink()
    scene = open_scene(folder)
    assert [note.split(",")[0] for note in scene.notes] == [
        "1 of 8 frames have no finite pose and are left out",
        "1 of 8 frames have no pose and are left out",
        "1 of 8 frames have no depth map",
    ]
    check_read(scene, room, [0, 1, 4, 5, 6, 7], depths=False)


def test_a_pose_that_is_no_motion_is_refused_with_its_file(tmp_path: Path):
    folder = with_intrinsics(tmp_path, miniature(frames=3))
    (folder / "frame-000001.pose.txt").write_text("1 0 0 0\n0 1 0 0\n0 0 2 0\n0 0 0 1\n")
    with pytest.raises(InputError, match=r"frame-000001\.pose\.txt: .*its columns are 1, 1 and 2 long\); divide"):
        open_scene(folder)
    (folder / "frame-000001.pose.txt").write_text("1 0 0\n0 1 0\n")
    with pytest.raises(InputError, match=r"frame-000001\.pose\.txt: expected a camera-to-world matrix of 4x4 or 3x4"):
        open_scene(folder)


def test_all_sequences_of_all_scenes_are_found_two_levels_below(tmp_path: Path):
    for name in ("chess/seq-01", "chess/seq-02", "fire/seq-01"):
        with_intrinsics(tmp_path / name, miniature(frames=2))
    assert [scene.name for scene in open_scenes(tmp_path)] == ["chess_seq-01", "chess_seq-02", "fire_seq-01"]
    with pytest.raises(InputError, match=r"there is one in .*seq-01"):
        open_scene(tmp_path / "chess")
