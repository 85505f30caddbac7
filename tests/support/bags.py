"""A room as a robot records it: a bag with a RealSense on a base that drives, written by rosbags."""

from __future__ import annotations

import struct
from collections.abc import Callable
from dataclasses import dataclass, field
from itertools import groupby, zip_longest
from pathlib import Path
from typing import Any

import cv2
import numpy as np
from miniatures import Miniature, quaternion
from rosbags.rosbag1 import Writer as Writer1
from rosbags.rosbag2 import StoragePlugin, Writer
from rosbags.typesys import Stores, get_types_from_msg, get_typestore
from scipy.spatial.transform import Rotation

START = 1_700_000_000_123_456_789
STEP = 100_000_000
"""Between pictures [ns]."""
K = np.array([[57.5, 0, 31.5], [0, 56.25, 24.5], [0, 0, 1]])
OPTICAL = "camera_color_optical_frame"
COLOUR, INFO, DEPTH = "/camera/color/image_raw", "/camera/color/camera_info", "/camera/aligned_depth_to_color/image_raw"


def rigid(rotation_vector: tuple[float, float, float], place: tuple[float, float, float]) -> np.ndarray:
    """A rigid motion."""
    pose = np.eye(4)
    pose[:3, :3] = Rotation.from_rotvec(rotation_vector).as_matrix()
    pose[:3, 3] = place
    return pose


BASE_FROM_LINK = rigid((0.1, -0.2, 0.3), (0.2, 0.0, 0.6))
LINK_FROM_OPTICAL = rigid((-1.2, 1.2, -1.2), (0.0, 0.015, 0.0))
MAP_FROM_ODOM = rigid((0.0, 0.0, 0.7), (3.0, -1.0, 0.0))
BASE_FROM_OPTICAL = BASE_FROM_LINK @ LINK_FROM_OPTICAL


@dataclass
class Bag:
    """Messages to be written, by the time at which they are recorded.

    Attributes:
        store: the types.
        messages: (time, topic, type, message).
    """

    store: Any = field(default_factory=lambda: get_typestore(Stores.ROS2_HUMBLE))
    messages: list[tuple[int, str, str, Any]] = field(default_factory=list)

    def type(self, name: str) -> Any:
        """A message type by its name ("Image")."""
        return next(kind for full, kind in self.store.types.items() if full.endswith(f"/msg/{name}"))

    def full(self, name: str) -> str:
        """The whole name of a message type."""
        return next(full for full in self.store.types if full.endswith(f"/msg/{name}"))

    def header(self, time: int, frame: str) -> Any:
        """A header."""
        named = {"seq": 0} if self.store is ROS1 else {}
        stamp = self.store.types["builtin_interfaces/msg/Time"](time // 10**9, time % 10**9)
        return self.type("Header")(stamp=stamp, frame_id=frame, **named)

    def add(self, logged: int, topic: str, name: str, **values: Any) -> None:
        """Add a message."""
        self.messages.append((logged, topic, self.full(name), self.type(name)(**values)))

    def image(
        self, time: int, topic: str, pixels: np.ndarray, encoding: str, frame: str = OPTICAL, pad: int = 0
    ) -> None:
        """Add an Image, its rows padded; it is recorded 30 ms after it was taken."""
        rows = np.ascontiguousarray(pixels).view(np.uint8).reshape(len(pixels), -1)
        rows = np.pad(rows, ((0, 0), (0, pad)), constant_values=7)
        self.add(
            time + 30_000_000, topic, "Image", header=self.header(time, frame), height=pixels.shape[0], width=pixels.shape[1],
            encoding=encoding, is_bigendian=int(pixels.dtype.byteorder == ">"), step=rows.shape[1], data=rows.ravel(),
        )  # fmt: skip

    def compressed(self, time: int, topic: str, data: bytes, kind: str, frame: str = OPTICAL) -> None:
        """Add a CompressedImage."""
        self.add(
            time + 30_000_000, topic, "CompressedImage", header=self.header(time, frame), format=kind,
            data=np.frombuffer(data, np.uint8),
        )  # fmt: skip

    def info(
        self, topic: str = INFO, k: np.ndarray = K, size: tuple[int, int] = (48, 64), d: tuple[float, ...] = (0.0,) * 5,
        frame: str = OPTICAL, model: str = "plumb_bob", binning: int = 0, roi: tuple[int, int, int, int] = (0, 0, 0, 0),
    ) -> None:  # fmt: skip
        """Add a CameraInfo; P has other numbers than K."""
        p = np.concatenate((k * [[0.9, 1, 1], [1, 0.9, 1], [1, 1, 1]], np.zeros((3, 1))), axis=1)
        arrays = {"d": np.array(d), "k": k.ravel().astype(float), "r": np.eye(3).ravel(), "p": p.ravel()}
        if self.store is ROS1:
            arrays = {name.upper(): value for name, value in arrays.items()}
        region = self.type("RegionOfInterest")(
            x_offset=roi[0], y_offset=roi[1], height=roi[2], width=roi[3], do_rectify=False
        )
        self.add(
            START, topic, "CameraInfo", header=self.header(START, frame), height=size[0], width=size[1], distortion_model=model,
            binning_x=binning, binning_y=binning, roi=region, **arrays,
        )  # fmt: skip

    def pose(self, pose: np.ndarray) -> tuple[Any, Any]:
        """A Point or Vector3 and a Quaternion of a pose."""
        x, y, z, w = quaternion(pose[:3, :3])
        return pose[:3, 3], self.type("Quaternion")(x=x, y=y, z=z, w=w)

    def transform(self, time: int, parent: str, child: str, pose: np.ndarray, topic: str = "/tf") -> None:
        """Add a transform."""
        place, turn = self.pose(pose)
        one = self.type("TransformStamped")(
            header=self.header(time, parent), child_frame_id=child,
            transform=self.type("Transform")(translation=self.type("Vector3")(*place), rotation=turn),
        )  # fmt: skip
        self.add(time + 1_000_000, topic, "TFMessage", transforms=[one])

    def odometry(self, time: int, topic: str, parent: str, child: str, pose: np.ndarray) -> None:
        """Add an Odometry."""
        place, turn = self.pose(pose)
        held = self.type("Pose")(position=self.type("Point")(*place), orientation=turn)
        still = self.type("Twist")(
            linear=self.type("Vector3")(0.0, 0.0, 0.0), angular=self.type("Vector3")(0.0, 0.0, 0.0)
        )
        self.add(
            time + 1_000_000, topic, "Odometry", header=self.header(time, parent), child_frame_id=child,
            pose=self.type("PoseWithCovariance")(pose=held, covariance=np.zeros(36)),
            twist=self.type("TwistWithCovariance")(twist=still, covariance=np.zeros(36)),
        )  # fmt: skip

    def stamped(self, time: int, topic: str, parent: str, pose: np.ndarray) -> None:
        """Add a PoseStamped."""
        place, turn = self.pose(pose)
        held = self.type("Pose")(position=self.type("Point")(*place), orientation=turn)
        self.add(time + 1_000_000, topic, "PoseStamped", header=self.header(time, parent), pose=held)

    def write(self, path: Path, storage: str = "mcap") -> Path:
        """Write all, in the order of the times at which they were recorded."""
        if self.store is ROS1:
            return self._write(path, Writer1(path), self.store.serialize_ros1)
        plugin = {"mcap": StoragePlugin.MCAP, "sqlite3": StoragePlugin.SQLITE3}[storage]
        return self._write(path, Writer(path, version=9, storage_plugin=plugin), self.store.serialize_cdr)

    def _write(self, path: Path, writer: Any, serialize: Callable[[Any, str], bytes]) -> Path:
        """Write to a writer."""
        path.parent.mkdir(parents=True, exist_ok=True)
        with writer:
            connections: dict[str, Any] = {}
            for time, topic, kind, message in sorted(self.messages, key=lambda one: one[0]):
                if topic not in connections:
                    connections[topic] = writer.add_connection(topic, kind, typestore=self.store)
                writer.write(connections[topic], time, serialize(message, kind))
        return path


ROS1 = get_typestore(Stores.ROS1_NOETIC)
ROS1.register(get_types_from_msg("geometry_msgs/TransformStamped[] transforms", "tf2_msgs/msg/TFMessage"))


def times(room: Miniature) -> list[int]:
    """When the pictures of a room are taken [ns]."""
    return [START + index * STEP for index in range(len(room))]


def around(time: int, pose: np.ndarray) -> list[tuple[int, np.ndarray]]:
    """Two poses, 20 ms before and after, between which `pose` lies in the middle: turned and moved by as much both ways."""
    turned = [rigid((0.02 * s, -0.05 * s, 0.03 * s), (0.0, 0.0, 0.0)) for s in (-1, 1)]
    found = []
    for sign, turn in zip((-1, 1), turned, strict=True):
        moved = pose @ turn
        moved[:3, 3] = pose[:3, 3] + sign * np.array([0.01, 0.02, -0.03])
        found.append((time + sign * 20_000_000, moved))
    return found


def add_camera(bag: Bag, room: Miniature) -> None:
    """Colour with padded rows, its CameraInfo, and depth registered to it, 5 ms late."""
    bag.info()
    for index, time in enumerate(times(room)):
        bag.image(time, COLOUR, room.images[index], "rgb8", pad=8)
        bag.image(time + 5_000_000, DEPTH, room.depths[index], "16UC1")


def add_tree(bag: Bag, room: Miniature) -> None:
    """TF: map > odom > base_link moving, base_link > camera_link > optical standing, as a robot with a SLAM system publishes."""
    bag.transform(START - STEP, "base_link", "camera_link", BASE_FROM_LINK, "/tf_static")
    bag.transform(START - STEP, "camera_link", OPTICAL, LINK_FROM_OPTICAL, "/tf_static")
    for time, pose in zip(times(room), room.poses, strict=True):
        base = np.linalg.inv(MAP_FROM_ODOM) @ pose @ np.linalg.inv(BASE_FROM_OPTICAL)
        bag.transform(time, "map", "odom", MAP_FROM_ODOM)
        for when, moved in around(time, base):
            bag.transform(when, "odom", "base_link", moved)


def robot(room: Miniature) -> Bag:
    """The whole recording."""
    bag = Bag()
    add_camera(bag, room)
    add_tree(bag, room)
    return bag


def jpeg(image: np.ndarray) -> bytes:
    """A JPEG of an RGB picture."""
    return cv2.imencode(".jpg", image[..., ::-1], [cv2.IMWRITE_JPEG_QUALITY, 95])[1].tobytes()


def png(array: np.ndarray) -> bytes:
    """A PNG of an RGB picture or a map."""
    return cv2.imencode(".png", array[..., ::-1] if array.ndim == 3 else array)[1].tobytes()


def rvl(counts: np.ndarray) -> bytes:
    """Depth as compressedDepth's RVL: columns, rows, then Wilson's code, nibble by nibble."""
    numbers, before = list[int](), 0
    runs = [list(run) for _, run in groupby(counts.ravel().tolist(), bool)]
    if runs[0][0]:
        runs.insert(0, [])
    for zeros, values in zip_longest(runs[::2], runs[1::2], fillvalue=[]):
        numbers += [len(zeros), len(values)]
        for value in values:
            numbers.append(2 * (value - before) if value >= before else 2 * (before - value) - 1)
            before = value
    nibbles = ""
    for number in numbers:
        octal = f"{number:o}"[::-1]
        nibbles += "".join(f"{int(digit) + 8:x}" for digit in octal[:-1]) + octal[-1]
    nibbles += "0" * (-len(nibbles) % 8)
    words = [int(nibbles[start : start + 8], 16) for start in range(0, len(nibbles), 8)]
    return struct.pack("<ii", *counts.shape[::-1]) + struct.pack(f"<{len(words)}I", *words)
