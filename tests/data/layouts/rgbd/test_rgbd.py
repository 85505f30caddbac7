"""RGB-D frames in folders with poses in text, in the manners in which people leave them."""

from __future__ import annotations

import json
import re
from pathlib import Path

import numpy as np
import pytest
from miniatures import (
    Miniature,
    back_projected,
    check_projection,
    check_read,
    miniature,
    quaternion,
    text,
    write_picture,
)

from semgs.data.scenes import open_scene
from semgs.files.errors import InputError
from semgs.files.images.pictures import write_tiff

K = np.array([[57.5, 0, 31.5], [0, 56.25, 24.5], [0, 0, 1]])


def write_maps(room: Miniature, colour: str, depth: str | None) -> None:
    """The pictures and depth maps at places such as "color/{0:03d}.png"."""
    for index in range(len(room)):
        write_picture(Path(colour.format(index)), room.images[index])
        if depth is not None:
            write_picture(Path(depth.format(index)), room.depths[index])


def pose_files(folder: Path, room: Miniature) -> Path:
    """color/0.png ... color/7.png, with a file for each pose."""
    write_maps(room, f"{folder}/color/{{}}.png", f"{folder}/depth/{{}}.png")
    (folder / "pose").mkdir()
    for index in range(len(room)):
        (folder / f"pose/{index}.txt").write_text(text(room.poses[index], "\r\n"))
    (folder / "intrinsics.txt").write_text(text(K))
    return folder


def nice_slam(folder: Path, room: Miniature) -> Path:
    """NICE-SLAM's Replica: results/frame000000.jpg, a matrix a line, and the camera in the folder above."""
    write_maps(room, f"{folder}/results/frame{{:06d}}.png", f"{folder}/results/depth{{:06d}}.png")
    (folder / "traj.txt").write_text("".join(text(pose.reshape(1, 16)) for pose in room.poses))
    camera = {"w": 64, "h": 48, "fx": 57.5, "fy": 56.25, "cx": 31.5, "cy": 24.5, "scale": 1000.0}
    (folder.parent / "cam_params.json").write_text(json.dumps({"camera": camera}))
    return folder


def redwood(folder: Path, room: Miniature) -> Path:
    """Redwood's image/ and depth/ with other times in their names, a .log, and Open3D's file of intrinsics."""
    write_maps(room, f"{folder}/image/{{0:06d}}-{{0:03d}}33.png", f"{folder}/depth/{{0:06d}}-{{0:03d}}66.png")
    log = "".join(f"{index} {index} {index + 1}\n{text(pose)}" for index, pose in enumerate(room.poses))
    (folder / "trajectory.log").write_text(log)
    (folder / "intrinsic.json").write_text(
        json.dumps({"width": 64, "height": 48, "intrinsic_matrix": K.T.ravel().tolist()})
    )
    return folder


def recorder(folder: Path, room: Miniature) -> Path:
    """As `redwood`, with the name that Open3D's recorder gives the file of intrinsics."""
    redwood(folder, room)
    (folder / "intrinsic.json").rename(folder / "camera_intrinsic.json")
    return folder


def side_by_side(folder: Path, room: Miniature) -> Path:
    """EmbodiedScan's 00000.jpg (here by name only), 00000.png, 00000.txt and a 4x4 intrinsic.txt."""
    write_maps(room, f"{folder}/{{0:05d}}.jpg", f"{folder}/{{0:05d}}.png")
    for index in range(len(room)):
        (folder / f"{index:05d}.txt").write_text(text(room.poses[index]))
    whole = np.eye(4)
    whole[:3, :3] = K
    (folder / "intrinsic.txt").write_text(text(whole))
    return folder


def sun3d(folder: Path, room: Miniature) -> Path:
    """SUN3D: all poses as 3x4 matrices below each other, depth rotated by three bits."""
    write_maps(room, f"{folder}/image/{{0:07d}}-{{0:012d}}.png", None)
    for index, depths in enumerate(room.depths):
        write_picture(folder / f"depth/{index:07d}-{index:012d}.png", (depths << 3) | (depths >> 13))
    (folder / "extrinsics").mkdir()
    (folder / "extrinsics/20140808220511.txt").write_text("".join(text(pose[:3]) for pose in room.poses))
    (folder / "intrinsics.txt").write_text(text(K))
    return folder


def by_time(folder: Path, room: Miniature) -> Path:
    """rgb/ and depth/ with times for names, and a trajectory as SLAM systems write it, not in order."""
    for index in range(len(room)):
        write_picture(folder / f"rgb/{100 + index / 10:.4f}.png", room.images[index])
        write_picture(folder / f"depth/{100.002 + index / 10:.4f}.png", room.depths[index])
    lines = [
        text(np.array([100.001 + index / 10, *pose[:3, 3], *quaternion(pose[:3, :3])]))
        for index, pose in enumerate(room.poses)
    ]
    (folder / "trajectory.txt").write_text("".join(lines[::-1]))
    (folder / "K.txt").write_text("57.5, 56.25, 31.5, 24.5")
    return folder


def quaternions_and_pgm(folder: Path, room: Miniature) -> Path:
    """A file a frame with tx ty tz qx qy qz qw, and depth as PGM, high byte first."""
    write_maps(room, f"{folder}/color/{{}}.png", None)
    (folder / "pose").mkdir()
    (folder / "depth").mkdir()
    for index, (pose, depths) in enumerate(zip(room.poses, room.depths, strict=True)):
        (folder / f"pose/{index}.txt").write_text(text(np.array([*pose[:3, 3], *quaternion(pose[:3, :3])])))
        header = f"P5\n# a comment\n{depths.shape[1]} {depths.shape[0]}\n10000\n".encode()
        (folder / f"depth/{index}.pgm").write_bytes(header + depths.astype(">u2").tobytes())
    (folder / "intrinsics.txt").write_text(text(K))
    return folder


def seven_a_line(folder: Path, room: Miniature) -> Path:
    """traj.txt with tx ty tz qx qy qz qw a line, in the order of the pictures."""
    write_maps(room, f"{folder}/rgb/{{}}.png", f"{folder}/depth/{{}}.png")
    lines = [text(np.array([*pose[:3, 3], *quaternion(pose[:3, :3])])) for pose in room.poses]
    (folder / "traj.txt").write_text("".join(lines))
    (folder / "K.txt").write_text("57.5, 56.25, 31.5, 24.5")
    return folder


IDS = (1, 4, 9, 17, 28, 41, 60, 102)
"""Of RTAB-Map's frames, which are those that it kept."""


def rtabmap(folder: Path, room: Miniature, start: str = "rtabmap_", poses: str = "camera_poses") -> Path:
    """RTAB-Map's export: files named by id, lines of time, pose and id that are not in order, and a calibration for each image."""
    lines = []
    (folder / f"{start}calib").mkdir(parents=True)
    for frame, image, depths, pose in zip(IDS, room.images, room.depths, room.poses, strict=False):
        write_picture(folder / f"{start}rgb/{frame}.png", image)
        write_picture(folder / f"{start}depth/{frame}.png", depths)
        numbers = text(np.array([1.6e9 + frame, *pose[:3, 3], *quaternion(pose[:3, :3])])).strip()
        lines.append(f"{numbers} {frame}\n")
        (folder / f"{start}calib/{frame}.yaml").write_text(
            f'%YAML:1.0\n---\ncamera_name: "{frame}"\nimage_width: 64\nimage_height: 48\ncamera_matrix:\n   rows: 3\n   cols: 3\n'
            "   data: [ 57.5, 0., 31.5, 0., 56.25,\n       24.5, 0., 0., 1. ]\n"
            "distortion_coefficients:\n   rows: 1\n   cols: 5\n   data: [ 0., 0., 0., 0., 0. ]\n"
            "local_transform:\n   rows: 3\n   cols: 4\n   data: [ 0., 0., 1., 0., -1., 0., 0., 0., 0., -1., 0., 0. ]\n"
        )
    (folder / f"{start}{poses}.txt").write_text("#timestamp x y z qx qy qz qw id\n" + "".join(lines[::-1]))
    return folder


MANNERS = {
    "pose files": pose_files,
    "NICE-SLAM": nice_slam,
    "Redwood": redwood,
    "Open3D's recorder": recorder,
    "side by side": side_by_side,
    "SUN3D": sun3d,
    "by time": by_time,
    "quaternions and PGM": quaternions_and_pgm,
    "seven a line": seven_a_line,
    "RTAB-Map": rtabmap,
}
STATES_NO_UNIT = ("pose files", "side by side", "by time", "quaternions and PGM", "seven a line")


@pytest.mark.parametrize("manner", MANNERS)
def test_what_is_read_equals_what_was_written(tmp_path: Path, manner: str):
    room = miniature()
    (tmp_path / "my room").mkdir()
    folder = MANNERS[manner](tmp_path / "my room", room)
    scene = open_scene(folder, depth_unit=0.001 if manner in STATES_NO_UNIT else None)
    check_read(scene, room)
    assert scene.unit == "metric"
    assert scene.name == "my room"
    assert not scene.notes
    depth = room.depths[5, 33, 20] / 1000
    check_projection(
        scene, 5, back_projected(room.poses[5], (57.5, 56.25), (31.5, 24.5), (33, 20), depth), (33, 20), depth
    )


@pytest.mark.parametrize("manner", STATES_NO_UNIT)
def test_depth_of_no_stated_unit_is_left_out_and_told(tmp_path: Path, manner: str):
    scene = open_scene(MANNERS[manner](tmp_path, miniature(frames=3)))
    assert scene.unit == "unknown"
    assert all(frame.depth is None for frame in scene.frames)
    assert scene.notes[0].startswith("3 depth maps are left out because their unit is unknown (--depth-unit 0.001")


def test_no_unit_is_asked_for_of_pictures_of_depth(tmp_path: Path):
    """Depth in colours, as viewers save it, cannot be read with any unit; a lone map of 16 bits can."""
    folder = pose_files(tmp_path, miniature(frames=4))
    maps = sorted((folder / "depth").iterdir())
    for file in maps:
        write_picture(file, np.zeros((48, 64, 3), np.uint8))
    scene = open_scene(folder)
    assert scene.unit == "unknown"
    assert all(frame.depth is None for frame in scene.frames)
    (note,) = scene.notes
    assert note.startswith(
        "4 of 4 depth maps are left out, as they are PNG of 8 bits in colour, not 16 bits of one channel"
    )
    write_picture(maps[1], np.full((48, 64), 2000, np.uint16))
    asked, left_out = (note for note in open_scene(folder).notes if "depth maps are" in note)
    assert asked.startswith("1 depth maps are left out because their unit is unknown (--depth-unit 0.001")
    assert left_out.startswith("3 of 4 depth maps are left out, as they are PNG of 8 bits in colour")


def test_depth_of_a_kind_that_is_not_read_is_told(tmp_path: Path):
    folder = pose_files(tmp_path, miniature(frames=3))
    for file in (folder / "depth").iterdir():
        file.rename(file.with_suffix(".exr"))
    scene = open_scene(folder)
    assert scene.unit == "unknown"
    assert scene.notes == (
        "depth/ has files of other kinds than .png, .npy, .pgm, .tif, .tiff (.exr): depth is left out.",
    )


@pytest.mark.parametrize("manner", ["pose files", "Redwood", "stated"])
def test_floating_point_tiff_has_the_unit_that_is_given(tmp_path: Path, manner: str):
    """It is never taken for the counts of a data set, or of a file of intrinsics."""
    room = miniature(frames=3)
    folder = MANNERS["pose files" if manner == "stated" else manner](tmp_path, room)
    if manner == "stated":
        (folder / "intrinsics.txt").unlink()
        camera = {"w": 64, "h": 48, "fx": 57.5, "fy": 56.25, "cx": 31.5, "cy": 24.5, "scale": 1000.0}
        (folder / "cam_params.json").write_text(json.dumps({"camera": camera}))
    for file, depths in zip(sorted((folder / "depth").iterdir()), room.depths, strict=True):
        write_tiff(file.with_suffix(".tiff"), depths / 1000)
        file.unlink()
    assert "3 depth maps are left out because their unit is unknown" in open_scene(folder).notes[0]
    check_read(open_scene(folder, depth_unit=1.0), room)


@pytest.mark.parametrize("manner", ["quaternions and PGM", "seven a line"])
def test_four_numbers_that_are_no_quaternion_are_refused_with_their_line(tmp_path: Path, manner: str):
    folder = MANNERS[manner](tmp_path, miniature(frames=3))
    file = folder / ("traj.txt" if manner == "seven a line" else "pose/0.txt")
    file.write_text("# angles are in degrees\n1 2 3 0 0 90 0\n" + "".join(file.read_text().splitlines(True)[1:]))
    with pytest.raises(
        InputError, match=r"txt: line 2: expected a unit quaternion .* found \[0.0, 0.0, 90.0, 0.0\] of length 90"
    ):
        open_scene(folder)


def test_numbers_count_as_people_count(tmp_path: Path):
    room = miniature(frames=8)
    twelve = Miniature(*(np.concatenate((one, one[:4])) for one in (room.images, room.depths, room.labels, room.poses)))
    scene = open_scene(pose_files(tmp_path, twelve), depth_unit=0.001)
    assert [frame.name for frame in scene.frames[:3]] == ["color/0.png", "color/1.png", "color/2.png"]
    check_read(scene, twelve)


def test_a_missing_map_is_counted_and_frames_are_paired_by_number(tmp_path: Path):
    room = miniature()
    folder = pose_files(tmp_path, room)
    (folder / "depth/3.png").unlink()
    (folder / "pose/5.txt").unlink()
    scene = open_scene(folder, depth_unit=0.001)
    assert [note.split(",")[0] for note in scene.notes] == [
        "1 of 8 frames have no pose and are left out",
        "1 of 8 frames have no depth map",
    ]
    check_read(scene, room, [0, 1, 2, 3, 4, 6, 7], depths=False)
    np.testing.assert_allclose(scene.read([4]).depths[0], room.depths[4] / 1000, atol=1e-3)


def test_a_pose_without_image_is_counted_if_poses_begin_at_1(tmp_path: Path):
    folder = pose_files(tmp_path, miniature(frames=4))
    for index in (3, 2, 1, 0):
        (folder / f"pose/{index}.txt").rename(folder / f"pose/{index + 1}.txt")
    scene = open_scene(folder, depth_unit=0.001)
    assert [frame.name for frame in scene.frames] == ["color/1.png", "color/2.png", "color/3.png"]
    assert "1 of 4 frames have no pose and are left out, the first is color/0.png." in scene.notes
    assert "1 of 4 poses have no image, the first is pose/4.txt." in scene.notes


def test_colours_and_depths_that_nothing_pairs_are_refused(tmp_path: Path):
    folder = pose_files(tmp_path, miniature(frames=4))
    for index in range(4):
        (folder / f"depth/{index}.png").rename(folder / f"depth/{'abcd'[index]}.png")
    assert len(open_scene(folder, depth_unit=0.001).read([0, 3]).depths) == 2
    (folder / "depth/b.png").unlink()
    with pytest.raises(InputError, match=r"expected depth maps that match .* found 4 images .* and 3 depth maps"):
        open_scene(folder)


def test_as_many_poses_as_pictures_or_none(tmp_path: Path):
    folder = nice_slam(tmp_path / "office0", miniature(frames=4))
    lines = (folder / "traj.txt").read_text().splitlines()
    (folder / "traj.txt").write_text("\n".join(lines[:3]))
    with pytest.raises(InputError, match=r"traj\.txt: expected as many poses as images: 4 in .*results, found 3 poses"):
        open_scene(folder)
    (folder / "traj.txt").write_text("\n".join([*lines[:3], "1 2 3"]))
    with pytest.raises(InputError, match=r"traj\.txt: line 4: expected poses as 8 numbers .* found 3 numbers"):
        open_scene(folder)


def test_without_intrinsics_they_are_asked_for(tmp_path: Path):
    room = miniature(frames=3)
    folder = pose_files(tmp_path, room)
    (folder / "intrinsics.txt").unlink()
    with pytest.raises(InputError, match=r"expected a file of intrinsics: .* or give them: --intrinsics fx fy cx cy"):
        open_scene(folder)
    check_read(open_scene(folder, intrinsics=(57.5, 56.25, 32.0, 25.0), depth_unit=0.001), room)


def test_given_intrinsics_replace_a_file_that_cannot_be_read(tmp_path: Path):
    """intrinsics.txt with distortion behind fx fy cx cy: 8 numbers, which are refused."""
    room = miniature()
    folder = pose_files(tmp_path, room)
    (folder / "intrinsics.txt").write_text("57.5 56.25 31.5 24.5 0.1 -0.2 0 0")
    with pytest.raises(InputError, match="intrinsics as a 3x3 or 4x4 matrix or as fx fy cx cy, found 8 numbers"):
        open_scene(folder)
    check_read(open_scene(folder, intrinsics=(57.5, 56.25, 32.0, 25.0), depth_unit=0.001), room)


def test_frames_of_rtabmap_are_paired_by_id_and_have_their_own_intrinsics(tmp_path: Path):
    """The first pose is missing; the second image has its own focal length."""
    room = miniature(frames=4)
    folder = rtabmap(tmp_path / "room", room, "", "poses")
    lines = (folder / "poses.txt").read_text().splitlines(keepends=True)
    (folder / "poses.txt").write_text("".join(lines[:-1]))
    own = folder / "calib/4.yaml"
    own.write_text(own.read_text().replace("57.5", "60.0"))
    scene = open_scene(folder)
    assert [frame.name for frame in scene.frames] == ["rgb/4.png", "rgb/9.png", "rgb/17.png"]
    assert [frame.lens.focal for frame in scene.frames] == [(60, 56.25), (57.5, 56.25), (57.5, 56.25)]
    for frame, pose in zip(scene.frames, room.poses[1:], strict=True):
        np.testing.assert_allclose(frame.world_from_camera, pose, atol=1e-6)
    assert scene.notes == ("1 of 4 frames have no pose and are left out, the first is rgb/1.png.",)
    own.unlink()
    with pytest.raises(InputError, match=r"expected a calibration of 4\.png in calib, found none"):
        open_scene(folder)
    assert open_scene(folder, intrinsics=(50.0, 50.0, 32.0, 24.0)).frames[0].lens.focal == (50, 50)


def test_a_trajectory_named_as_eurocs_is_read_with_a_note(tmp_path: Path):
    room = miniature()
    folder = seven_a_line(tmp_path, room)
    (folder / "traj.txt").write_text(
        "# p_RS_R_x p_RS_R_y p_RS_R_z q_RS_x q_RS_y q_RS_z q_RS_w\n" + (folder / "traj.txt").read_text()
    )
    scene = open_scene(folder, depth_unit=0.001)
    check_read(scene, room)
    assert "Poses in traj.txt are taken for the camera's." in scene.notes[0]


def test_poses_of_rtabmaps_robot_are_no_cameras(tmp_path: Path):
    with pytest.raises(
        InputError, match=r"rtabmap_poses\.txt has cameras of RTAB-Map \(of the robot; .*--poses_camera"
    ):
        open_scene(rtabmap(tmp_path, miniature(frames=3), poses="poses"))


@pytest.mark.parametrize(
    ("old", "new", "message"),
    [
        ("data: [ 0., 0., 0.,", "data: [ 0.1, 0., 0.,", "distortion_coefficients: expected images without distortion"),
        ("camera_matrix", "cam", "expected a camera_matrix with the 9 numbers of its data, found 0 numbers"),
        ("57.5,", "57.5, x,", "camera_matrix: expected numbers, found"),
        ("image_width: 64", "image_width: 80", "expected intrinsics for 64x48 pixels"),
    ],
)
def test_a_calibration_in_yaml_that_is_not_used_is_refused(tmp_path: Path, old: str, new: str, message: str):
    folder = rtabmap(tmp_path, miniature(frames=3))
    file = folder / "rtabmap_calib/1.yaml"
    file.write_text(file.read_text().replace(old, new))
    with pytest.raises(InputError, match=rf"1\.yaml: {re.escape(message)}"):
        open_scene(folder)


def test_redwood_without_a_file_has_the_primesense(tmp_path: Path):
    folder = redwood(tmp_path, miniature(frames=3))
    (folder / "intrinsic.json").unlink()
    lens = open_scene(folder).frames[0].lens
    assert (*lens.focal, *lens.centre) == (52.5, 52.5, 32, 24)


@pytest.mark.parametrize(
    ("name", "content", "message"),
    [
        ("intrinsics.txt", "57 0 31\n0 57 24\n", "6 numbers"),
        ("intrinsics.txt", "57 0 31\n0 -57 24\n0 0 1", "positive focal lengths"),
        (
            "intrinsics.txt",
            "57 0 310\n0 57 24\n0 0 1",
            r"principal point inside images of 64x48 .* \(310\.5, 24\.5\)",
        ),
        ("intrinsics.txt", "1 2 3 4 5 6 7 8 9", "a camera matrix"),
        ("intrinsics.txt", "fx = 57", "line 1: expected numbers"),
        ("intrinsics.json", '{"fx": 57}', "intrinsics as fx, fy, cx, cy or as a matrix, found keys fx"),
        (
            "intrinsics.json",
            '{"fx": 57, "fy": 57, "cx": 300, "cy": 200, "width": 640, "height": 480}',
            "some for 640x480",
        ),
    ],
)
def test_intrinsics_that_cannot_be_are_refused_with_their_file(tmp_path: Path, name: str, content: str, message: str):
    folder = pose_files(tmp_path, miniature(frames=2))
    (folder / "intrinsics.txt").unlink()
    (folder / name).write_text(content)
    with pytest.raises(InputError, match=f"{name.replace('.', '[.]')}: .*{message}"):
        open_scene(folder)


def test_what_a_layout_does_not_leave_open_cannot_be_asked(tmp_path: Path):
    folder = pose_files(tmp_path, miniature(frames=2))
    with pytest.raises(InputError, match=r"camera: expected a ROS bag, found layout RGB-D folders; leave it out"):
        open_scene(folder, camera="/camera/color")
    with pytest.raises(ValueError, match=r"depth_unit is -1"):
        open_scene(folder, depth_unit=-1.0)
    with pytest.raises(ValueError, match=r"intrinsics are \(0\.0, 1\.0, 2\.0, 3\.0\)"):
        open_scene(folder, intrinsics=(0.0, 1.0, 2.0, 3.0))


def test_two_frames_side_by_side_are_enough(tmp_path: Path):
    scene = open_scene(side_by_side(tmp_path, miniature().first(2)), depth_unit=0.001)
    assert [frame.name for frame in scene.frames] == ["00000.jpg", "00001.jpg"]


def test_a_matrix_in_json_that_is_no_matrix_is_refused_with_the_keys_of_the_file(tmp_path: Path):
    folder = redwood(tmp_path, miniature())
    (folder / "intrinsic.json").write_text(json.dumps({"intrinsic_matrix": "fx 0 cx", "width": 64, "height": 48}))
    with pytest.raises(
        InputError, match=r"expected intrinsics as fx, fy, cx, cy or as a matrix, found keys height, intrinsic_m"
    ):
        open_scene(folder)
