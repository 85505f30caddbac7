"""Messages with the attributes that rclpy's have, made here of plain Python."""

from __future__ import annotations

from array import array
from types import SimpleNamespace as Message

import cv2
import numpy as np
import pytest
from bags import jpeg, png

from semgs import ros
from semgs.data.cameras.lens import Lens
from semgs.mapping.stream import FrameReader

FRAME = "camera_optical"
PIXELS = np.arange(2 * 3 * 3, dtype=np.uint8).reshape(2, 3, 3)
"""An image of 2 x 3 pixels, RGB: the first is (0, 1, 2)."""


def header(frame: str = FRAME) -> Message:
    return Message(stamp=Message(sec=12, nanosec=250_000_000), frame_id=frame)


def image(pixels: np.ndarray, encoding: str, pad: int = 0, frame: str = FRAME) -> Message:
    """An Image whose rows end with `pad` more bytes; rclpy's data is an array of bytes."""
    rows = np.pad(
        np.ascontiguousarray(pixels).view(np.uint8).reshape(len(pixels), -1), ((0, 0), (0, pad)), constant_values=9
    )
    return Message(
        header=header(frame), height=pixels.shape[0], width=pixels.shape[1], encoding=encoding,
        is_bigendian=int(pixels.dtype.byteorder == ">"), step=rows.shape[1], data=array("B", rows.tobytes()),
    )  # fmt: skip


def compressed(data: bytes, kind: str) -> Message:
    return Message(header=header(), format=kind, data=array("B", data))


def info(size: tuple[int, int] = (2, 3), d: tuple[float, ...] = ()) -> Message:
    """A CameraInfo, the centre of the first pixel at (0, 0); P has another focal length than K."""
    k = np.array([4.0, 0, 1.25, 0, 5.0, 0.75, 0, 0, 1]) * ([size[1] / 3] * 8 + [1])
    p = np.array([6.0, 0, 1.0, 0, 0, 7.0, 0.5, 0, 0, 0, 1, 0])
    region = Message(x_offset=0, y_offset=0, height=0, width=0)
    return Message(
        header=header(), height=size[0], width=size[1], distortion_model="plumb_bob", d=array("d", d), k=k, p=p,
        binning_x=0, binning_y=0, roi=region,
    )  # fmt: skip


TURN = Message(x=0.0, y=0.0, z=np.sqrt(0.5), w=np.sqrt(0.5))
"""A quarter turn about z: x becomes y, y becomes -x."""
MATRIX = np.array([[0, -1, 0, 1.5], [1, 0, 0, -2], [0, 0, 1, 0.25], [0, 0, 0, 1.0]])


def transform(child: str = FRAME) -> Message:
    moved = Message(translation=Message(x=1.5, y=-2.0, z=0.25), rotation=TURN)
    return Message(header=header("map"), child_frame_id=child, transform=moved)


def test_a_frame_has_pixels_pose_intrinsics_from_the_pixels_corner_and_time_in_seconds():
    pixels, pose, intrinsics, time = ros.frame_from_messages(image(PIXELS, "rgb8", pad=5), info(), transform())
    np.testing.assert_array_equal(pixels, PIXELS)
    np.testing.assert_allclose(pose, MATRIX, atol=1e-15)
    np.testing.assert_array_equal(intrinsics, [[4, 0, 1.75], [0, 5, 1.25], [0, 0, 1]])
    assert time == 12.25
    _, _, rectified, _ = ros.frame_from_messages(image(PIXELS, "rgb8"), info(), transform(), rectified=True)
    np.testing.assert_array_equal(rectified, [[6, 0, 1.5], [0, 7, 1], [0, 0, 1]])


def test_a_stream_takes_the_frame():
    ignored: list[str] = []
    reader = FrameReader((0.5, 10.0), (2, 3))
    view = reader.read(ros.frame_from_messages(image(PIXELS, "rgb8"), info(), transform()), ignored.append)
    assert ignored == []
    assert view is not None
    assert view.images[0, :, 0, 0].tolist() == pytest.approx([0, 1 / 255, 2 / 255])
    np.testing.assert_allclose(view.cameras.centres[0].numpy(), [1.5, -2, 0.25])


@pytest.mark.parametrize(
    ("message", "expected"),
    [
        (image(PIXELS, "rgb8"), PIXELS),
        (image(PIXELS, "bgr8"), PIXELS[..., ::-1]),
        (image(PIXELS[..., 0], "mono8", pad=1), np.repeat(PIXELS[..., :1], 3, -1)),
        (compressed(png(PIXELS), "rgb8; png compressed bgr8"), PIXELS),
    ],
    ids=["rgb8", "bgr8", "mono8", "png"],
)
def test_encodings_of_colour(message: Message, expected: np.ndarray):
    np.testing.assert_array_equal(ros.frame_from_messages(message, info(), transform())[0], expected)


def test_a_jpeg_is_nearly_its_image():
    smooth = np.full((16, 24, 3), (200, 100, 50), np.uint8)
    pixels = ros.frame_from_messages(compressed(jpeg(smooth), "jpeg"), info((16, 24)), transform())[0]
    assert np.abs(pixels.astype(int) - smooth).max() <= 3


@pytest.mark.parametrize("encoding", ["rgb32", "bayer_grbg16", "", "16UC1", "32FC1"])
def test_other_encodings_are_refused_in_one_line(encoding: str):
    with pytest.raises(ValueError, match=r"rgb8|expected colours") as refused:
        ros.frame_from_messages(image(PIXELS, encoding), info(), transform())
    assert "\n" not in str(refused.value)


def test_distortion_is_undone_in_image_and_intrinsics():
    size, d = (48, 64), (-0.2, 0.05, 0.001, -0.002, 0.0)
    picture = np.random.default_rng(3).integers(0, 255, (6, 8, 3), np.uint8).repeat(8, 0).repeat(8, 1)
    said = info(size, d)
    pixels, _, intrinsics, _ = ros.frame_from_messages(image(picture, "rgb8"), said, transform())
    lens = Lens(size, (said.k[0], said.k[4]), (said.k[2] + 0.5, said.k[5] + 0.5), d)
    np.testing.assert_array_equal(pixels, lens.undistorted(picture, lens.maps()))
    np.testing.assert_array_equal(intrinsics, lens.intrinsics)
    assert not np.array_equal(pixels, picture)


@pytest.mark.parametrize("part", ["pose", "transform", "stamped pose", "stamped transform"])
def test_four_messages_have_a_pose(part: str):
    pose = Message(position=Message(x=1.5, y=-2.0, z=0.25), orientation=TURN)
    moved = transform()
    message = {
        "pose": pose, "transform": moved.transform, "stamped pose": Message(header=header("map"), pose=pose), "stamped transform": moved,
    }[part]  # fmt: skip
    np.testing.assert_allclose(ros.pose_matrix(message), MATRIX, atol=1e-15)


def test_a_pose_that_nobody_filled_and_a_transform_of_another_frame_are_refused():
    empty = Message(position=Message(x=0.0, y=0.0, z=0.0), orientation=Message(x=0.0, y=0.0, z=0.0, w=0.0))
    with pytest.raises(ValueError, match="expected finite numbers, not all 0"):
        ros.pose_matrix(empty)
    with pytest.raises(ValueError, match="of the frame base_link; expected that of the image, camera_optical"):
        ros.frame_from_messages(image(PIXELS, "rgb8"), info(), transform("base_link"))
    with pytest.raises(ValueError, match=r"CameraInfo for 3x2 pixels .* found 640x480"):
        ros.frame_from_messages(image(PIXELS, "rgb8"), info((480, 640)), transform())


COUNTS = np.array([[1000, 0, 2500], [65535, 1, 40]])
METRES = [[1, 0, 2.5], [0, 0.001, 0.04]]  # 0 and 65535 mean that nothing was measured, as in bags and files


@pytest.mark.parametrize(
    ("depth", "metres"),
    [
        (image(COUNTS.astype("<u2"), "16UC1", pad=2), METRES),
        (image(COUNTS.astype(">u2"), "16UC1"), METRES),
        (image(np.array([[1, np.nan, 2.5], [np.inf, -1, 0.04]], "<f4"), "32FC1"), [[1, 0, 2.5], [0, 0, 0.04]]),
        (compressed(bytes(12) + cv2.imencode(".png", COUNTS.astype(np.uint16))[1].tobytes(), "16UC1; compressedDepth png"), METRES),
    ],
    ids=["16UC1", "16UC1 big", "32FC1", "compressedDepth"],
)  # fmt: skip
def test_depth_becomes_metres_and_0_where_unknown(depth: Message, metres: np.ndarray):
    views = ros.views_from_messages([image(PIXELS, "rgb8")], [info()], [transform()], [depth], depth_range=(0.1, 9.0))
    assert views.depths is not None
    np.testing.assert_allclose(views.depths[0].numpy(), metres, rtol=1e-6)
    assert views.depth_range.tolist() == [[0.1, 9.0]]


def test_depth_that_is_not_registered_to_the_image_is_refused():
    depth = image(COUNTS.astype("<u2"), "16UC1", frame="depth_optical")
    with pytest.raises(ValueError, match="frame depth_optical; expected camera_optical, registered"):
        ros.views_from_messages([image(PIXELS, "rgb8")], [info()], [transform()], [depth])
    with pytest.raises(ValueError, match="has colours"):
        ros.views_from_messages([image(PIXELS, "rgb8")], [info()], [transform()], [image(PIXELS, "rgb8")])


def test_two_views_keep_their_order():
    second = image(PIXELS[::-1], "rgb8")
    views = ros.views_from_messages([image(PIXELS, "rgb8"), second], [info()] * 2, [transform()] * 2)
    assert (255 * views.images[1, :, 0, 0]).round().tolist() == PIXELS[1, 0].tolist()
    assert views.depths is None
