"""ROS bags: poses in time along the tree of frames, pictures of all encodings, and what is told where a bag leaves a choice."""

from __future__ import annotations

import io
import pickle
import re
import struct
import threading
from copy import deepcopy
from dataclasses import replace
from pathlib import Path

import cv2
import numpy as np
import pytest
from bags import (
    BASE_FROM_LINK,
    BASE_FROM_OPTICAL,
    COLOUR,
    DEPTH,
    INFO,
    LINK_FROM_OPTICAL,
    MAP_FROM_ODOM,
    OPTICAL,
    ROS1,
    START,
    STEP,
    Bag,
    add_camera,
    add_tree,
    jpeg,
    png,
    robot,
    rvl,
    times,
)
from miniatures import back_projected, check_projection, check_read, miniature

from semgs.data.layouts.ros.bag import BagFile, stamp_of
from semgs.data.layouts.ros.camera import lens_of
from semgs.data.layouts.ros.cut_bags import recordings_of
from semgs.data.layouts.ros.image_messages import as_file, decode_rvl, ending_of
from semgs.data.scene import Scene
from semgs.data.scenes import open_scene, open_scenes
from semgs.files.errors import InputError

ROOM = miniature()
FEW = ROOM.first(3)


def pictures_alone(room=FEW) -> Bag:
    """Colour and CameraInfo, no depth and no poses."""
    bag = Bag()
    bag.info()
    for time, image in zip(times(room), room.images, strict=True):
        bag.image(time, COLOUR, image, "rgb8")
    return bag


def refused(bag: Bag, path: Path, **asked: object) -> str:
    """What is said of a bag that is refused."""
    with pytest.raises(InputError) as told:
        open_scene(bag.write(path / "bag"), **asked)
    return str(told.value)


@pytest.mark.parametrize("storage", ["mcap", "sqlite3"])
def test_what_is_read_equals_what_was_written(tmp_path: Path, storage: str):
    scene = open_scene(robot(ROOM).write(tmp_path / "my bag", storage))
    check_read(scene, ROOM)
    assert (scene.name, scene.layout, scene.unit) == ("my bag", "ROS bag", "metric")
    assert [frame.name for frame in scene.frames[:2]] == ["1700000000.123456789.png", "1700000000.223456789.png"]
    assert scene.notes == (
        f"Images are from {COLOUR}.",
        f"Poses are from TF: map > odom > base_link > camera_link > {OPTICAL}, interpolated in time.",
    )


def test_a_point_is_where_opencvs_formula_puts_it(tmp_path: Path):
    scene = open_scene(robot(FEW).write(tmp_path / "bag"))
    depth = FEW.depths[1, 30, 41] / 1000
    check_projection(
        scene, 1, back_projected(FEW.poses[1], (57.5, 56.25), (31.5, 24.5), (30, 41), depth), (30, 41), depth
    )


def test_one_file_is_a_bag_and_a_folder_may_hold_several(tmp_path: Path):
    bag = robot(FEW)
    bag.write(tmp_path / "runs" / "first")
    file = next(bag.write(tmp_path / "second").glob("*.mcap")).rename(tmp_path / "runs" / "second.mcap")
    check_read(open_scene(file), FEW)
    assert [scene.name for scene in open_scenes(tmp_path / "runs")] == ["first", "second"]


def test_ros_1_is_read_too(tmp_path: Path):
    bag = Bag(ROS1)
    add_camera(bag, FEW)
    add_tree(bag, FEW)
    check_read(open_scene(bag.write(tmp_path / "run.bag")), FEW)


def test_scenes_of_bags_go_to_other_threads_and_processes(tmp_path: Path):
    scene = pickle.loads(pickle.dumps(open_scene(robot(FEW).write(tmp_path / "bag", "sqlite3"))))
    failures: list[BaseException] = []

    def read() -> None:
        try:
            check_read(scene, FEW)
        except BaseException as error:
            failures.append(error)

    threads = [threading.Thread(target=read) for _ in range(2)]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    assert failures == []


# Where the poses come from.


def test_odometry_moves_the_base_that_the_camera_stands_on(tmp_path: Path):
    bag = pictures_alone()
    bag.transform(START, "base_link", OPTICAL, BASE_FROM_OPTICAL, "/tf_static")
    for time, pose in zip(times(FEW), FEW.poses, strict=True):
        bag.odometry(time, "/wheel/odometry", "odom", "base_link", pose @ np.linalg.inv(BASE_FROM_OPTICAL))
    path = bag.write(tmp_path / "bag")
    for world in (None, "odom", "/odom", "/wheel/odometry"):
        scene = open_scene(path, world=world)
    check_read(scene, FEW, depths=False)
    assert f"Poses are from /wheel/odometry: odom > base_link > {OPTICAL}, interpolated in time." in scene.notes


@pytest.mark.parametrize("body", [None, "camera_link"])
def test_posestamped_is_of_the_camera_or_of_the_body_that_is_named(tmp_path: Path, body: str | None):
    bag = pictures_alone()
    bag.transform(START, "camera_link", OPTICAL, LINK_FROM_OPTICAL, "/tf_static")
    for time, pose in zip(times(FEW), FEW.poses, strict=True):
        bag.stamped(time, "/mocap/pose", "world", pose if body is None else pose @ np.linalg.inv(LINK_FROM_OPTICAL))
    scene = open_scene(bag.write(tmp_path / "bag"), body=body)
    check_read(scene, FEW, depths=False)
    assert any("assumed to be those of the camera's frame" in note for note in scene.notes) == (body is None)


def test_the_world_may_be_any_frame_above_the_camera(tmp_path: Path):
    path = robot(FEW).write(tmp_path / "bag")
    views = open_scene(path, world="odom").read([0, 1, 2])
    in_odom = np.linalg.inv(MAP_FROM_ODOM) @ FEW.poses
    np.testing.assert_allclose(views.cameras.world_from_camera, in_odom, atol=1e-6)
    for world in ("moon", "base_link"):  # in base_link the camera never moves
        with pytest.raises(
            InputError, match=rf"world: expected poses of {OPTICAL} in {world}, .* < base_link < odom < map"
        ):
            open_scene(path, world=world)


def test_of_several_parents_in_tf_the_wanted_one_is_used_and_else_a_note_names_them(tmp_path: Path):
    """A second program says that the base never moves in its own frame, in fewer messages."""
    bag = robot(FEW)
    moving = [one for one in bag.messages if one[1] == "/tf" and one[3].transforms[0].child_frame_id == "base_link"]
    for message in moving[1:]:
        still = deepcopy(message)
        still[3].transforms[0].header.frame_id = "gps"
        still[3].transforms[0].transform.translation.x = 0.0
        still[3].transforms[0].transform.translation.y = 0.0
        still[3].transforms[0].transform.translation.z = 0.0
        bag.messages.append(still)
    path = bag.write(tmp_path / "bag")
    scene = open_scene(path)
    np.testing.assert_allclose([frame.world_from_camera for frame in scene.frames], FEW.poses, atol=1e-6)
    note = "TF gives base_link several parents, odom, gps; odom is used. --world gps uses another one."
    assert note in scene.notes
    centres = [frame.world_from_camera[:3, 3] for frame in open_scene(path, world="gps").frames]
    turned = np.linalg.inv(MAP_FROM_ODOM) @ FEW.poses @ np.linalg.inv(BASE_FROM_OPTICAL)
    expected = [pose[:3, :3] @ BASE_FROM_OPTICAL[:3, 3] for pose in turned]
    np.testing.assert_allclose(centres, expected[-len(centres) :], atol=1e-6)


def test_odometry_goes_on_where_tf_ends(tmp_path: Path):
    bag = pictures_alone()
    bag.transform(START, "base_link", OPTICAL, BASE_FROM_OPTICAL, "/tf_static")
    for time, pose in zip(times(FEW), FEW.poses, strict=True):
        bag.transform(time, "map", "odom", MAP_FROM_ODOM)
        base = np.linalg.inv(MAP_FROM_ODOM) @ pose @ np.linalg.inv(BASE_FROM_OPTICAL)
        bag.odometry(time, "/odom", "odom", "base_link", base)
    check_read(open_scene(bag.write(tmp_path / "bag"), world="map"), FEW, depths=False)


def test_pictures_before_after_and_in_long_gaps_are_left_out_and_counted(tmp_path: Path):
    room = miniature(frames=8)
    bag = Bag()
    add_camera(bag, room)
    bag.transform(START, "base_link", OPTICAL, BASE_FROM_OPTICAL, "/tf_static")
    base = room.poses @ np.linalg.inv(BASE_FROM_OPTICAL)
    for index in (1, 2, 3, 6):  # 4 and 5 lie between two poses 0.3 s apart, 0 before and 7 after all
        bag.transform(START + index * STEP, "odom", "base_link", base[index])
    scene = open_scene(bag.write(tmp_path / "bag"))
    assert [frame.name[9:12] for frame in scene.frames] == ["0.2", "0.3", "0.4", "0.5", "0.6", "0.7"]
    assert (
        "2 of 8 images are at times without a known pose and are left out, the first is at 1700000000.123 s."
        in scene.notes
    )
    bag.messages = [one for one in bag.messages if one[0] != START + 6 * STEP + 1_000_000]
    bag.transform(START + 3 * STEP + 1_100_000_000, "odom", "base_link", base[6])
    assert len(open_scene(bag.write(tmp_path / "gap"))) == 3


def test_a_bag_of_too_few_poses_says_when_they_are(tmp_path: Path):
    bag = pictures_alone()
    bag.transform(START, "base_link", OPTICAL, BASE_FROM_OPTICAL, "/tf_static")
    bag.transform(START + 10**10, "odom", "base_link", np.eye(4))
    bag.transform(START + 2 * 10**10, "odom", "base_link", np.eye(4))
    line = refused(bag, tmp_path)
    assert "expected at least two images at times with known poses, found 0 of 3" in line
    assert "/tf has odom > base_link from 1700000010.123 to 1700000020.123 s" in line


# Which camera, which intrinsics.


def two_cameras() -> Bag:
    """A robot with two cameras of colour and one of infrared."""
    bag = robot(FEW)
    for side in ("left", "right"):
        bag.info(f"/{side}/camera_info", frame=f"{side}_optical")
        bag.transform(START, "base_link", f"{side}_optical", BASE_FROM_OPTICAL, "/tf_static")
        for time, image in zip(times(FEW), FEW.images, strict=True):
            bag.image(
                time,
                f"/{side}/image_raw",
                image if side == "left" else image[:, ::-1].copy(),
                "rgb8",
                f"{side}_optical",
            )
    return bag


def test_several_cameras_are_listed_and_one_is_named(tmp_path: Path):
    path = two_cameras().write(tmp_path / "bag")
    with pytest.raises(
        InputError, match=r"camera: expected one camera, found /camera/color/image_raw \(3\), /left/image_raw \(3\), "
    ):
        open_scene(path)
    check_read(open_scene(path, camera="/camera/color"), FEW)
    for camera in ("/left", "/left/image_raw"):
        scene = open_scene(path, camera=camera)
        check_read(scene, FEW, depths=False)
        assert (
            scene.notes[-1]
            == f"Depth in {DEPTH} is left out: it is in the frame {OPTICAL}, not registered to the images."
        )
    with pytest.raises(InputError, match=r"camera: expected images in a topic that begins with /lef, found /camera"):
        open_scene(path, camera="/lef")


def test_the_one_camera_with_colour_is_taken_among_grey_ones(tmp_path: Path):
    bag = robot(FEW)
    for time, image in zip(times(FEW), FEW.images, strict=True):
        bag.image(time, "/camera/infra1/image_rect_raw", image[..., 0].copy(), "mono8", "camera_infra1_optical_frame")
    check_read(open_scene(bag.write(tmp_path / "bag")), FEW)


def test_of_one_camera_plain_pictures_come_before_compressed_and_rectified_before_raw(tmp_path: Path):
    bag = robot(FEW)
    for time, image in zip(times(FEW), FEW.images, strict=True):
        bag.compressed(time, COLOUR + "/compressed", jpeg(image), "rgb8; jpeg compressed bgr8")
    assert open_scene(bag.write(tmp_path / "a")).notes[0] == f"Images are from {COLOUR}."
    for time, image in zip(times(FEW), FEW.images, strict=True):
        bag.image(time, "/camera/color/image_rect_color", image, "rgb8")
    scene = open_scene(bag.write(tmp_path / "b"))
    assert scene.notes[0] == "Images are from /camera/color/image_rect_color."
    assert scene.frames[0].lens.focal == (57.5 * 0.9, 56.25 * 0.9)  # of P, not of K


def info(**settings: object) -> object:
    """A CameraInfo."""
    bag = Bag()
    bag.info(**settings)
    return bag.messages[0][3]


def test_raw_pictures_have_their_distortion_undone():
    message = info(d=(0.1, -0.02, 0.001, 0.002, 0.003, 0.0, 0.0, 0.0), model="rational_polynomial")
    lens = lens_of(Path("bag"), INFO, message, (48, 64), rectified=False)
    assert lens_of(Path("bag"), INFO, message, (48, 64), rectified=True).is_pinhole
    assert lens.distortion == (0.1, -0.02, 0.001, 0.002, 0.003)
    assert lens.centre == (32, 25)


@pytest.mark.parametrize(
    ("settings", "focal", "centre"),
    [
        ({"size": (96, 128), "binning": 2}, (28.75, 28.125), (16.0, 12.5)),
        ({"size": (300, 400), "roi": (10, 4, 48, 64)}, (57.5, 56.25), (22.0, 21.0)),
        ({"size": (300, 400), "roi": (10, 4, 96, 128), "binning": 2}, (28.75, 28.125), (11.0, 10.5)),
    ],
)
def test_binning_and_regions_of_interest_move_the_camera(settings: dict, focal: tuple, centre: tuple):
    lens = lens_of(Path("bag"), INFO, info(**settings), (48, 64), rectified=False)
    assert (lens.focal, lens.centre) == (focal, centre)


@pytest.mark.parametrize(
    ("settings", "message"),
    [
        ({"size": (480, 640)}, "a CameraInfo for 64x48 pixels .* found 640x480; or give .* --intrinsics fx fy cx cy"),
        (
            {"k": np.zeros((3, 3))},
            "a calibrated camera, found a focal length of zero in K, the matrix of raw images; or give",
        ),
        (
            {"k": np.full((3, 3), np.nan)},
            "a calibrated camera, found NaN or infinity in K, the matrix of raw images; or give",
        ),
        (
            {"k": np.array([[57.5, 0, np.nan], [0, 56, 24], [0, 0, 1]])},
            "a calibrated camera, found NaN or infinity in K",
        ),
        ({"d": (0.1, 0.2, 0.3, 0.4), "model": "equidistant"}, "a lens of plumb_bob .* found equidistant"),
        ({"d": (0.1, 0, 0, 0, 0, 0.2, 0, 0), "model": "rational_polynomial"}, "a lens of plumb_bob"),
        ({"d": (-9.0, 0.0, 0.0, 0.0, 0.0)}, "a possible camera"),
    ],
)
def test_intrinsics_that_cannot_be_used_are_refused_with_their_topic(settings: dict, message: str):
    with pytest.raises(InputError, match=f"bag: {INFO}: expected {message}"):
        lens_of(Path("bag"), INFO, info(**settings), (48, 64), rectified=False)


# What the messages hold.


def message(**values: object) -> object:
    """An Image or CompressedImage by its fields."""
    bag = Bag()
    kind = "Image" if "encoding" in values else "CompressedImage"
    return bag.type(kind)(header=bag.header(START, OPTICAL), **values)


def raw(pixels: np.ndarray, encoding: str, **values: int) -> object:
    """An Image of an array."""
    data = np.ascontiguousarray(pixels).view(np.uint8).reshape(len(pixels), -1)
    sizes = {"height": pixels.shape[0], "width": pixels.shape[1], "step": data.shape[1], "is_bigendian": 0} | values
    return message(encoding=encoding, data=data.ravel(), **sizes)


def decoded(one: object) -> np.ndarray:
    """The RGB, grey or depth pixels of the file of a message."""
    data = as_file(one)
    if ending_of(one) == ".npy":
        return np.load(io.BytesIO(data))
    pixels = cv2.imdecode(np.frombuffer(data, np.uint8), cv2.IMREAD_UNCHANGED)
    return pixels[..., ::-1] if pixels.ndim == 3 else pixels


def test_pixels_of_all_encodings_are_what_they_say():
    rgb = FEW.images[0]
    alpha = np.full((*rgb.shape[:2], 1), 9, np.uint8)
    for encoding, pixels in {
        "rgb8": rgb, "bgr8": rgb[..., ::-1], "8UC3": rgb[..., ::-1],
        "rgba8": np.concatenate((rgb, alpha), -1), "bgra8": np.concatenate((rgb[..., ::-1], alpha), -1),
    }.items():  # fmt: skip
        np.testing.assert_array_equal(decoded(raw(pixels, encoding)), rgb)
    np.testing.assert_array_equal(decoded(raw(rgb[..., 0], "mono8")), np.repeat(rgb[..., :1], 3, -1))
    flat = np.broadcast_to(np.array([200, 100, 50], np.uint8), (16, 24, 3))
    for encoding, order in {
        "rggb": (0, 1, 1, 2),
        "bggr": (2, 1, 1, 0),
        "gbrg": (1, 2, 0, 1),
        "grbg": (1, 0, 2, 1),
    }.items():
        mosaic = np.zeros((16, 24), np.uint8)
        for place, channel in enumerate(order):
            mosaic[place // 2 :: 2, place % 2 :: 2] = flat[0, 0, channel]
        np.testing.assert_array_equal(decoded(raw(mosaic, f"bayer_{encoding}8"))[4:-4, 4:-4], flat[4:-4, 4:-4])
    red = np.full((4, 6), 81, np.uint8)  # of BT.601: Y 81, U 90, V 240
    chroma = np.tile(np.array([90, 240], np.uint8), (4, 3))
    for encoding, pair in {"yuv422": (chroma, red), "yuv422_yuy2": (red, chroma)}.items():
        colour = decoded(raw(np.stack(pair, axis=-1), encoding))
        assert np.abs(colour.astype(int) - (254, 0, 0)).max() <= 3


def test_depth_is_millimetres_or_metres_plain_or_compressed():
    depths = FEW.depths[0]
    np.testing.assert_array_equal(decoded(raw(depths, "16UC1")), depths)
    np.testing.assert_array_equal(decoded(raw(depths.astype(">u2"), "16UC1", is_bigendian=1)), depths)
    metres = depths.astype(np.float32) / 1000
    np.testing.assert_array_equal(decoded(raw(metres, "32FC1")), metres)
    head = struct.pack("<iff", 0, 0.0, 0.0)
    packed = message(format="16UC1; compressedDepth png", data=np.frombuffer(head + png(depths), np.uint8))
    np.testing.assert_array_equal(decoded(packed), depths)
    a, b = 100.0 * 101.0, 1 - 101.0 * 100.0 / 10.0  # what compressed_depth_image_transport takes for 10 m and 100
    inverse = np.where(metres > 0, a / np.maximum(metres, 1e-3) + b, 0).astype(np.uint16)
    packed = message(
        format="32FC1; compressedDepth png", data=np.frombuffer(struct.pack("<iff", 0, a, b) + png(inverse), np.uint8)
    )
    np.testing.assert_allclose(decoded(packed), metres, atol=0.01)


# By hand: 2 zeros, 3 values, +5, +2, -3 as 10, 4, 5, 1 zero, no value; 10 takes two nibbles, A and 1.
SIX_PIXELS = struct.pack("<iiI", 3, 2, 0x23A14510)


def test_rvl_is_read_nibble_by_nibble():
    assert decode_rvl(SIX_PIXELS).tolist() == [[0, 0, 5], [7, 4, 0]]
    assert rvl(np.array([[0, 0, 5], [7, 4, 0]])) == SIX_PIXELS


@pytest.mark.parametrize("share", [0.0, 0.3, 1.0])
def test_rvl_of_any_counts_is_what_was_written(share: float):
    rng = np.random.default_rng(3)
    counts = rng.integers(1, 1 << 16, (37, 53)).astype(np.uint16)
    counts[rng.random(counts.shape) < share] = 0
    np.testing.assert_array_equal(decode_rvl(rvl(counts)), counts)


@pytest.mark.parametrize(
    ("data", "message"),
    [
        (b"", "without its size"),
        (SIX_PIXELS[:8], "ends early"),
        (struct.pack("<iiI", 1 << 16, 1 << 16, 0), "65536x65536 pixels"),
        (struct.pack("<iiI", 3, -2, 0), "3x-2 pixels"),
        (struct.pack("<ii", 3, 2) + bytes(89), "97 bytes for 3x2 pixels"),
        (struct.pack("<iiI", 2, 2, 0x23A14510), "another number of pixels"),
        (struct.pack("<iiI", 3, 2, 0x23A14000), "another number of pixels|ends early"),
        (struct.pack("<iiII", 3, 2, 0xFFFFFFFF, 0xFFF10000), "too large"),
        (struct.pack("<iiI", 1, 1, 0x01100000), "more than 16 bits"),  # -1
    ],
)
def test_damaged_rvl_is_refused(data: bytes, message: str):
    with pytest.raises(ValueError, match=message):
        decode_rvl(data)


@pytest.mark.parametrize(
    "form", ["16UC1; compressedDepth rvl", "16UC1;compressedDepth RVL", "32FC1; compressedDepth rvl"]
)
def test_depth_compressed_by_rvl_is_read(tmp_path: Path, form: str):
    bag = pictures_alone()
    add_tree(bag, FEW)
    a, b = 60_000.0, 10.0
    for time, depths in zip(times(FEW), FEW.depths, strict=True):
        counts, head = depths, struct.pack("<iff", 0, 0.0, 0.0)
        if form.startswith("32"):  # inverse depth: counts of a / z + b
            counts = np.where(depths > 0, a / np.maximum(depths / 1000, 1e-3) + b, 0).astype(np.uint16)
            head = struct.pack("<iff", 0, a, b)
        bag.compressed(time, DEPTH + "/compressedDepth", head + rvl(counts), form)
    scene = open_scene(bag.write(tmp_path / "bag"))
    for frame, depths in zip(scene.frames, FEW.depths, strict=True):
        np.testing.assert_allclose(frame.measured(), depths / 1000, atol=1e-3)


@pytest.mark.parametrize(
    ("form", "data", "reason"),
    [
        ("16UC1; jpeg compressed ", jpeg(FEW.images[0]), "JPEG"),
        ("16UC1; png compressed ", png((FEW.depths[0] // 256).astype(np.uint8)), "no 16-bit PNG"),
        ("16UC1; compressedDepth zdepth", bytes(99), "neither a 16-bit PNG nor RVL"),
        ("16UC1; compressedDepth rvl", bytes(12) + SIX_PIXELS[:-4], "ends early"),
    ],
)
def test_depth_that_cannot_be_read_is_left_out_and_the_images_are_read(
    tmp_path: Path, form: str, data: bytes, reason: str
):
    bag = pictures_alone()
    add_tree(bag, FEW)
    for time in times(FEW):
        bag.compressed(time, DEPTH + "/compressedDepth", data, form)
    scene = open_scene(bag.write(tmp_path / "bag"))
    assert [frame.depth for frame in scene.frames] == [None, None, None]
    assert re.search(rf"Depth in {DEPTH}/compressedDepth is left out: .*{reason}", scene.notes[-1])
    np.testing.assert_array_equal(scene.frames[0].read_image(), FEW.images[0])


def test_images_at_the_same_time_are_left_out_and_counted(tmp_path: Path):
    bag = robot(FEW)
    one = next(message for message in bag.messages if message[1] == COLOUR)
    bag.messages.append((one[0] + 5, *one[1:]))
    scene = open_scene(bag.write(tmp_path / "bag"))
    assert len(scene) == 3
    assert "1 of 4 images have the same time in their header as another and are left out." in scene.notes


def test_a_driver_that_sets_no_times_is_named(tmp_path: Path):
    bag = Bag()
    bag.info()
    for time, image in zip(times(FEW), FEW.images, strict=True):
        bag.image(0, COLOUR, image, "rgb8")
        logged, *rest = bag.messages.pop()
        bag.messages.append((time + logged, *rest))
    add_tree(bag, FEW)
    said = refused(bag, tmp_path)
    assert "found 3 images that all have the time 0.000; the driver has to set header.stamp" in said


@pytest.mark.parametrize("compressed", [False, True])
def test_depth_in_metres_is_read_with_its_holes(tmp_path: Path, compressed: bool):
    bag = pictures_alone()
    add_tree(bag, FEW)
    for time, depths in zip(times(FEW), FEW.depths, strict=True):
        if compressed:
            data = struct.pack("<iff", 0, 0.0, 0.0) + png(depths)
            bag.compressed(time, DEPTH + "/compressedDepth", data, "16UC1; compressedDepth png")
        else:
            bag.image(time, DEPTH, np.where(depths > 0, depths / 1000, np.nan).astype(np.float32), "32FC1")
    check_read(open_scene(bag.write(tmp_path / "bag")), FEW)


def test_compressed_pictures_are_the_files_that_they_hold(tmp_path: Path):
    bag = robot(FEW)
    bag.messages = [one for one in bag.messages if one[1] != COLOUR]
    for time, image in zip(times(FEW), FEW.images, strict=True):
        bag.compressed(time, COLOUR + "/compressed", png(image), "rgb8; png compressed bgr8")
    check_read(open_scene(bag.write(tmp_path / "bag")), FEW)


def test_a_depth_map_that_is_missing_is_counted(tmp_path: Path):
    bag = robot(FEW)
    bag.messages.remove(next(one for one in bag.messages if one[1] == DEPTH))
    scene = open_scene(bag.write(tmp_path / "bag"))
    assert scene.notes[-1] == f"1 of 3 images have no depth map in {DEPTH} at their time."
    assert [frame.depth is None for frame in scene.frames] == [True, False, False]


# What cannot be read.


def test_a_bag_without_the_topics_lists_what_there_is(tmp_path: Path):
    bag = Bag()
    add_tree(bag, FEW)
    assert (
        "camera: expected topics of type Image or CompressedImage, found topics /tf (TFMessage), /tf_static"
        in refused(bag, tmp_path / "a")
    )
    line = refused(pictures_alone(), tmp_path / "b")
    assert (
        f"world: expected poses of {OPTICAL} by TF, Odometry or PoseStamped, found no TF; a bag needs /tf and /tf_static"
        in line
    )
    bag = pictures_alone()
    bag.transform(times(FEW)[0], "lidar", "imu", FEW.poses[0], "/tf_static")
    assert f"found TF of other frames, none of {OPTICAL}; a bag needs" in refused(bag, tmp_path / "other")
    bag.transform(times(FEW)[0], "mount", OPTICAL, FEW.poses[0], "/tf_static")
    assert f"found TF from the camera up: {OPTICAL} < mount, which never moves; a bag" in refused(
        bag, tmp_path / "still"
    )
    bag = robot(FEW)
    bag.messages = [one for one in bag.messages if one[1] != INFO]
    line = refused(bag, tmp_path / "c")
    assert f"{COLOUR}: expected a CameraInfo in {INFO}, or one of the frame {OPTICAL}, found none" in line
    assert "--intrinsics fx fy cx cy" in line
    assert "body: expected a topic whose poses do not name their frame" in refused(
        robot(FEW), tmp_path / "d", body="base_link"
    )


def test_several_topics_of_poses_are_listed(tmp_path: Path):
    bag = pictures_alone()
    bag.transform(START, "base_link", "camera_link", BASE_FROM_LINK, "/tf_static")
    bag.transform(START, "camera_link", OPTICAL, LINK_FROM_OPTICAL, "/tf_static")
    for time, pose in zip(times(FEW), FEW.poses, strict=True):
        for topic, frame in (("/wheels", "odom"), ("/visual", "vio")):
            bag.odometry(time, topic, frame, "base_link", pose @ np.linalg.inv(BASE_FROM_OPTICAL))
    assert (
        "world: expected one topic of poses, found /visual (vio); /wheels (odom); choose one: --world TOPIC"
        in refused(bag, tmp_path)
    )
    for world in ("vio", "/visual"):
        scene: Scene = open_scene(tmp_path / "bag", world=world)
        check_read(scene, FEW, depths=False)
        assert "Poses are from /visual: vio" in scene.notes[1]


@pytest.mark.parametrize("topics", [[COLOUR], [COLOUR, "/camera/color/camera_info"]], ids=["one", "all"])
def test_a_topic_whose_name_is_a_number_is_refused(tmp_path: Path, topics: list[str]):
    path = pictures_alone().write(tmp_path / "bag")
    described = (path / "metadata.yaml").read_text()
    for number, topic in enumerate(topics, 5):
        described = described.replace(f"name: {topic}\n", f"name: {number}\n")
    (path / "metadata.yaml").write_text(described)
    with pytest.raises(
        InputError, match=r"bag: metadata\.yaml: expected names of topics, found [56], which is not text"
    ):
        open_scene(path)


def test_a_topic_whose_type_is_a_number_is_refused(tmp_path: Path):
    path = pictures_alone().write(tmp_path / "bag")
    described = (path / "metadata.yaml").read_text()
    (path / "metadata.yaml").write_text(described.replace("type: sensor_msgs/msg/Image\n", "type: 1.5\n"))
    with pytest.raises(
        InputError, match=r"bag: metadata\.yaml: expected types of topics, found 1\.5, which is not text"
    ):
        open_scene(path)


def test_numbers_of_messages_that_are_text_are_refused(tmp_path: Path):
    path = pictures_alone().write(tmp_path / "bag")
    file = path / "metadata.yaml"
    file.write_text(re.sub(r"message_count: \d+", "message_count: some", file.read_text()))
    with pytest.raises(InputError, match=r"bag: (metadata\.yaml: expected numbers of messages|expected a ROS bag)"):
        open_scene(path)


def test_the_missing_transform_between_two_trees_is_named(tmp_path: Path):
    bag = robot(FEW)
    bag.messages = [one for one in bag.messages if one[1] != "/tf_static"]
    line = refused(bag, tmp_path / "a")
    assert "/tf: odom > base_link" in line
    assert f"no transform leads from base_link, which moves, to {OPTICAL}: record it on /tf_static, " in line
    assert f"base_link, which moves, to {OPTICAL}" in refused(bag, tmp_path / "b", world="odom")
    bag.transform(START - STEP, "camera_link", OPTICAL, LINK_FROM_OPTICAL, "/tf_static")
    assert "no transform leads from base_link, which moves, to camera_link: " in refused(bag, tmp_path / "c")
    assert "no transform leads" not in refused(robot(FEW), tmp_path / "d", world="moon")


@pytest.mark.parametrize(
    ("profile", "encoding", "said"),
    [
        ("ros1", "ros1", "found an MCAP of ROS 1; use the .bag that it was made from"),
        (
            "",
            "protobuf",
            "found an MCAP of another program than ROS 2, with messages in protobuf; record the topics of ROS 2 instead",
        ),
        ("x", "json", "found an MCAP of another program than ROS 2, with messages in json; "),
        ("", "", "found an MCAP of another program than ROS 2; "),
    ],
)
def test_an_mcap_of_another_program_is_named(tmp_path: Path, profile: str, encoding: str, said: str):
    writer_of = pytest.importorskip("mcap.writer").Writer
    path = tmp_path / "a.mcap"
    with path.open("wb") as file:
        writer = writer_of(file)
        writer.start(profile=profile, library="a test")
        schema = writer.register_schema("Text", "", b"")
        writer.add_message(writer.register_channel("/text", encoding, schema), 1, b"", 1)
        writer.finish()
    with pytest.raises(InputError, match=f"expected a ROS bag, {re.escape(said)}"):
        open_scene(path)


@pytest.mark.parametrize("field", ["encoding", "width", "data", "header"])
def test_a_bag_that_names_a_field_of_an_image_otherwise_is_refused(tmp_path: Path, field: str):
    """A bag says itself what the fields of its messages are."""
    path = robot(FEW).write(tmp_path / "bag")
    (file,) = path.glob("*.mcap")
    data = file.read_bytes()
    new = re.sub(rf"( {field})(?=\s)".encode(), f" {field[:-1]}x".encode(), data)
    assert new != data
    file.write_bytes(new)
    with pytest.raises(InputError, match="bag: expected "):
        open_scene(path).read([0])


def test_damage_is_told_with_the_bag(tmp_path: Path):
    path = robot(FEW).write(tmp_path / "bag")
    scene = open_scene(path)
    (file,) = path.glob("*.mcap")
    data = file.read_bytes()
    file.write_bytes(b"damaged" + data[7:])
    (path / "metadata.yaml").touch()  # so that the open reader is not taken
    with pytest.raises(InputError, match=r"bag: expected a ROS bag, found one that rosbags cannot read"):
        open_scene(path)
    with pytest.raises(InputError, match="one that rosbags cannot read"):
        scene.read([0])
    file.unlink()
    with pytest.raises(InputError, match="cannot read: Some database files are missing"):
        open_scene(path)
    bag = pictures_alone()
    add_tree(bag, FEW)
    bag.messages = [one for one in bag.messages if one[1] != COLOUR]
    for time in times(FEW):
        bag.image(time, COLOUR, FEW.images[0], "rgb32")
    assert f"{COLOUR} at 1700000000.123456789: expected an image, found pixels encoded as 'rgb32'" in refused(
        bag, tmp_path / "b"
    )


@pytest.mark.parametrize(
    ("stamp", "name"), [(1_700_000_001_500_000_000, "1700000001.500000000.png"), (7, "0.000000007.png")]
)
def test_a_frame_is_named_by_its_seconds_and_nine_decimals(stamp: int, name: str):
    assert BagFile(Path("bag"), COLOUR, 0, stamp, ".png").name == name


def test_rows_and_columns_can_be_binned_by_different_numbers():
    message = replace(info(size=(96, 256)), binning_x=4, binning_y=2)
    lens = lens_of(Path("bag"), INFO, message, (48, 64), rectified=False)
    assert (lens.focal, lens.centre) == ((57.5 / 4, 56.25 / 2), (8.0, 12.5))


def test_of_two_poses_at_the_same_time_the_first_counts(tmp_path: Path):
    """As in tf2. The repeated ones are a metre off."""
    bag = robot(FEW)
    for message in [one for one in bag.messages if one[1] == "/tf"]:
        wrong = deepcopy(message)
        wrong[3].transforms[0].transform.translation.x += 1
        bag.messages.append((wrong[0] + 5, *wrong[1:]))
    scene = open_scene(bag.write(tmp_path / "bag"))
    np.testing.assert_allclose([frame.world_from_camera for frame in scene.frames], FEW.poses, atol=1e-6)


def test_images_whose_time_was_not_set_are_left_out_and_counted(tmp_path: Path):
    """Poses at the time 0 are there, too, so the images would get one of them."""
    room = ROOM.first(4)
    bag = robot(room)
    for _, topic, _, message in bag.messages:
        for one in message.transforms if topic == "/tf" else [message] if topic == COLOUR else []:
            if stamp_of(one) <= times(room)[1]:
                one.header.stamp.sec = one.header.stamp.nanosec = 0
    scene = open_scene(bag.write(tmp_path / "bag"))
    assert len(scene) == 2
    assert "2 of 4 images have the time 0 in their header, or that of another, and are left out." in scene.notes
    np.testing.assert_allclose([frame.world_from_camera for frame in scene.frames], room.poses[2:], atol=1e-6)


@pytest.mark.parametrize("broken", ["zero quaternion", "NaN quaternion", "NaN position"])
def test_poses_that_are_none_are_counted(tmp_path: Path, broken: str):
    """Two of the six between odom and base_link: the image between them gets a pose from the others, and a note says so."""
    bag = robot(FEW)
    steps = [
        one[3].transforms[0]
        for one in bag.messages
        if one[1] == "/tf" and one[3].transforms[0].child_frame_id == "base_link"
    ]
    for step in steps[2:4]:
        turn, place = step.transform.rotation, step.transform.translation
        turn.x, turn.y, turn.z, turn.w = {"zero quaternion": (0.0,) * 4, "NaN quaternion": (np.nan,) * 4}.get(
            broken, (0.0, 0.0, 0.0, 1.0)
        )
        place.x = np.nan if broken == "NaN position" else place.x
    scene = open_scene(bag.write(tmp_path / "bag"))
    assert (
        "2 of 6 poses of base_link in /tf are left out, as they are not finite or have a quaternion of zero: images at their times have interpolated poses."
        in scene.notes
    )


@pytest.mark.parametrize("share", [0.5, 0.75, 0.99])
@pytest.mark.parametrize("alone", [False, True])
def test_of_a_recording_that_ends_early_what_is_there_is_read(tmp_path: Path, share: float, alone: bool):
    """As when its recorder is killed: the end with the list of all messages is missing, and the last record may be incomplete."""
    folder = robot(ROOM).write(tmp_path / "bag")
    file = next(folder.glob("*.mcap"))
    whole = file.read_bytes()
    file.write_bytes(whole[: int(share * len(whole))])
    scene = open_scene(file if alone else folder)
    assert (
        f"The recording {file.name} ends early: what is before its end is read; mcap recover repairs it." in scene.notes
    )
    assert 2 <= len(scene) <= len(ROOM)
    poses = [frame.world_from_camera for frame in scene.frames]
    np.testing.assert_allclose(poses, ROOM.poses[: len(scene)], atol=1e-6)
    np.testing.assert_array_equal(scene.frames[1].read_image(), ROOM.images[1])


def test_a_recording_that_only_lacks_its_last_bytes_loses_no_frame(tmp_path: Path):
    folder = robot(ROOM).write(tmp_path / "bag")
    file = next(folder.glob("*.mcap"))
    file.write_bytes(file.read_bytes()[:-20])
    check_read(open_scene(folder), ROOM)


@pytest.mark.parametrize("storage", ["mcap", "sqlite3"])
@pytest.mark.parametrize("stated", ["''", "", '""'])
def test_a_list_of_topics_that_does_not_say_how_they_are_stored_is_no_obstacle(
    tmp_path: Path, storage: str, stated: str
):
    folder = robot(FEW).write(tmp_path / "bag", storage)
    text = (folder / "metadata.yaml").read_text()
    (folder / "metadata.yaml").write_text(re.sub(r"storage_identifier: .*", f"storage_identifier: {stated}", text))
    check_read(open_scene(folder), FEW)


def test_a_storage_of_another_kind_is_refused_without_a_report_to_others(tmp_path: Path):
    folder = robot(FEW).write(tmp_path / "bag")
    text = (folder / "metadata.yaml").read_text()
    (folder / "metadata.yaml").write_text(re.sub(r"storage_identifier: .*", "storage_identifier: rosbag_v9", text))
    with pytest.raises(InputError, match="Storage plugin 'rosbag_v9' not supported") as told:
        open_scene(folder)
    assert "report issue" not in str(told.value)


@pytest.mark.parametrize("bigendian", [False, True])
def test_colours_of_sixteen_bits_are_rounded_to_eight(bigendian: bool):
    """257 counts are one step of 8 bits: 300 is 1, 400 is 2 (1.56)."""
    wide = np.full((4, 6, 3), (300, 400, 65535), ">u2" if bigendian else "<u2")
    for encoding, expected in {"rgb16": (1, 2, 255), "bgr16": (255, 2, 1), "16UC3": (255, 2, 1)}.items():
        found = decoded(raw(wide, encoding, is_bigendian=int(bigendian)))
        np.testing.assert_array_equal(found, np.full((4, 6, 3), expected))


def test_planes_of_brightness_and_colour_are_read():
    """Red of BT.601: Y 81, U 90, V 240. NV12 has U and V in turn, NV21 V and U, I420 first all U."""
    grey, u, v = np.full((4, 6), 81, np.uint8), 90, 240
    for encoding, chroma in {
        "nv12": np.tile(np.array([u, v], np.uint8), (2, 3)), "nv21": np.tile(np.array([v, u], np.uint8), (2, 3)),
        "i420": np.array([[u] * 6, [v] * 6], np.uint8),
    }.items():  # fmt: skip
        colour = decoded(raw(np.concatenate((grey, chroma)), encoding, height=4))
        assert colour.shape == (4, 6, 3)
        assert np.abs(colour.astype(int) - (254, 0, 0)).max() <= 3
    with pytest.raises(ValueError, match="24 bytes of 6x4 pixels in rows of 6 bytes; expected 36"):
        as_file(raw(grey, "nv12", height=4))


@pytest.mark.parametrize(("encoding", "least"), [("bgr8", 18), ("16UC1", 12), ("rgb16", 36), ("nv12", 6)])
def test_rows_that_are_too_short_for_their_pixels_are_refused(encoding: str, least: int):
    message = raw(np.zeros((4, least), np.uint8), encoding, height=4, width=6, step=least - 1)
    with pytest.raises(ValueError, match=f"step is {least - 1}; {encoding} of 6 pixels needs at least {least}"):
        as_file(message)


@pytest.mark.parametrize("topic", ["/camera/infra1/image_rect_raw", COLOUR])
def test_a_camera_of_sixteen_bits_of_grey_is_read_if_it_is_the_only_one(tmp_path: Path, topic: str):
    bag = pictures_alone()
    add_tree(bag, FEW)
    grey = FEW.images[..., 1].astype(np.uint16) * 257
    bag.messages = [one for one in bag.messages if one[1] not in (COLOUR, INFO)]
    bag.info(f"{topic.rpartition('/')[0]}/camera_info")
    for time, image in zip(times(FEW), grey, strict=True):
        bag.image(time, topic, image, "mono16")
    scene = open_scene(bag.write(tmp_path / "bag"))
    np.testing.assert_array_equal(scene.frames[0].read_image(), np.repeat(FEW.images[0, ..., 1:2], 3, -1))
    assert scene.frames[0].depth is None


def test_depth_as_the_only_images_is_no_camera(tmp_path: Path):
    bag = pictures_alone()
    bag.messages = [one for one in bag.messages if one[1] != COLOUR]
    for time, depth in zip(times(FEW), FEW.depths, strict=True):
        bag.image(time, "/camera/depth/image_raw", depth, "mono16")
    assert "expected topics of type Image or CompressedImage" in refused(bag, tmp_path)


def test_without_p_a_rectified_camera_has_k(tmp_path: Path):
    """P of zeros: the focal length is K's, 57.5 px."""
    told = info()
    told.p = np.zeros(12)
    expected = lens_of(tmp_path, INFO, told, (48, 64), rectified=False)
    assert lens_of(tmp_path, INFO, told, (48, 64), rectified=True) == expected
    told.d = np.array([0.1, 0, 0, 0, 0])
    with pytest.raises(InputError, match="found a focal length of zero in P, the matrix of rectified images; or give"):
        lens_of(tmp_path, INFO, told, (48, 64), rectified=True)
    told.p[:] = np.nan
    with pytest.raises(InputError, match="found NaN or infinity in P, the matrix of rectified images; or give"):
        lens_of(tmp_path, INFO, told, (48, 64), rectified=True)


@pytest.mark.parametrize(
    ("name", "program"),
    [("a.mcap.zstd", "zstd"), ("a.db3.zst", "zstd"), ("a.bag.gz", "gzip"), ("A.MCAP.ZSTD", "zstd")],
)
def test_recordings_that_are_compressed_as_a_whole_say_what_unpacks_them(tmp_path: Path, name: str, program: str):
    """Given by themselves, or in a folder without metadata.yaml, where a file ._NAME of macOS does not count."""
    file = tmp_path / name
    file.write_bytes(b"\x28\xb5\x2f\xfd")
    (tmp_path / f"._{name}").touch()
    told = f"found no known layout; {name} is a recording that is compressed by {program}; unpack it first: {program} -d {file}"
    for path in (file, tmp_path):
        for opened in (open_scene, open_scenes):
            with pytest.raises(InputError) as error:
                opened(path)
            assert str(error.value).endswith(told)


def test_files_of_macos_beside_recordings_are_ignored(tmp_path: Path):
    """A list of topics that does not say what its recordings are lets each of them be opened."""
    (tmp_path / "metadata.yaml").write_text("storage_identifier: ''\n")
    for name in ("a.db3", "._a.db3"):
        (tmp_path / name).touch()
    assert recordings_of(tmp_path) == [tmp_path / "a.db3"]


def test_a_recording_of_the_realsense_sdk_is_named_whatever_is_given(tmp_path: Path):
    """It has images and a CameraInfo in topics of its own, in the frame 0, and no poses."""
    bag = Bag(ROS1)
    bag.add(1, "/file_version", "UInt32", data=4)
    bag.info("/device_0/sensor_1/Color_0/info/camera_info", frame="")
    for time, image in zip(times(FEW), FEW.images, strict=True):
        bag.image(time, "/device_0/sensor_1/Color_0/image/data", image, "rgb8", "0")
    path = bag.write(tmp_path / "viewer.bag")
    for asked in ({}, {"intrinsics": (57.5, 56.25, 32.0, 25.0)}):
        with pytest.raises(InputError) as told:
            open_scene(path, **asked)
        assert str(told.value) == (
            f"{path}: expected a ROS bag with poses, found a recording of the RealSense SDK (RealSense Viewer), which has none; extract its "
            "photos, rs-convert -c -i viewer.bag -p PHOTOS/, and estimate cameras, semgs poses PHOTOS --out OUT; or record with the RealSense ROS "
            "wrapper and odometry"
        )


def test_the_topics_of_others_do_not_make_a_recording_of_the_realsense_sdk(tmp_path: Path):
    bag = robot(FEW)
    bag.add(START, "/file_version", "UInt32", data=4)
    check_read(open_scene(bag.write(tmp_path / "bag")), FEW)


@pytest.mark.parametrize(("storage", "ending"), [("mcap", ".mcap"), ("sqlite3", ".db3")])
def test_a_bag_without_its_metadata_is_told_how_to_get_it(tmp_path: Path, storage: str, ending: str):
    """One of several parts is not suggested, as it would be read without the others."""
    folder = robot(FEW).write(tmp_path / "all" / "run", storage)
    (folder / "metadata.yaml").unlink()
    file = next(folder.glob(f"*{ending}")).rename(folder / f"run_0{ending}")
    reindex = f"without metadata.yaml; ros2 bag reindex {folder} writes it"
    (folder / f"._run_0{ending}").touch()
    for path in (folder, folder.parent):
        with pytest.raises(InputError) as told:
            open_scene(path)
        assert str(told.value).endswith(f"; {folder} is a ROS bag {reindex}, or open {file} alone")
    (folder / f"run_1{ending}").write_bytes(file.read_bytes())
    for path in (folder, folder.parent):
        with pytest.raises(InputError) as told:
            open_scene(path)
        assert str(told.value).endswith(f"; {folder} has recordings {reindex} if they are parts of one bag")
