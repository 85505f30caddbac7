"""Messages in: images, depth, cameras and poses as frames of a stream, and as views. Messages out: points, things, class names and free floor, as rosbags' types of ROS 2.

For those that go out, `header` is any object with `stamp` and `frame_id`, such as the header of the latest transform; every message has the same. Positions are in the frame of the poses
that the scene was made with.
"""

from __future__ import annotations

import io
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import torch
from jaxtyping import Float32, Float64, UInt8

from semgs.data.cameras.lens import Lens
from semgs.data.frames import undistortion
from semgs.data.layouts.ros.bag import frame_id_of, stamp_of
from semgs.data.layouts.ros.camera import lens_of
from semgs.data.layouts.ros.image_messages import as_file, is_depth, pixels_of
from semgs.data.maps import MILLIMETRE, known_depths
from semgs.data.tables.classes import ClassTable
from semgs.data.views import INDOOR_DEPTH_RANGE, Views
from semgs.export.points import cloud_message, make_points
from semgs.export.scene_objects import PlacedThing, place_things
from semgs.files.bags import message_store
from semgs.files.errors import check_type
from semgs.files.images.pictures import MOST_PIXELS, decode_png, decode_rgb
from semgs.geometry.rotations import matrix_from_quaternion, quaternion_from_matrix
from semgs.robotics.objects import Objects
from semgs.robotics.occupancy import Occupancy
from semgs.scene.scene_file import SavedScene

PosedImage = tuple[UInt8[np.ndarray, "h w 3"], Float64[np.ndarray, "4 4"], Float64[np.ndarray, "3 3"], float]
"""Image, pose, intrinsics and time, the frame that `semgs.stream` takes."""

LEAST_NORM = 1e-6
"""Length of a quaternion that is a rotation; an empty message has 0."""


@dataclass(frozen=True)
class UndistortedImage:
    """A message's image without distortion.

    Attributes:
        image: RGB.
        lens: as the message's camera is, with the distortion.
    """

    image: UInt8[np.ndarray, "h w 3"]
    lens: Lens


def frame_from_messages(image: Any, info: Any, pose: Any, *, rectified: bool = False) -> PosedImage:
    """A frame for `semgs.stream`: image [h w 3] uint8, world_from_camera [4 4], intrinsics [3 3] in pixels, and time in seconds.

    Args:
        image: sensor_msgs/Image (rgb8, bgr8, mono8, and what else the reader of bags knows) or CompressedImage.
        info: its sensor_msgs/CameraInfo. Distortion is undone.
        pose: of the camera's optical frame, as for `pose_matrix`. "World" is the frame that it is given in.
        rectified: whether the image has no distortion any more (image_rect); then P of the CameraInfo is used instead of K.

    Raises:
        ValueError: the encoding is not supported, the CameraInfo does not belong to the image, or the pose is none, or is that of another frame.
    """
    for what, message, part in (("an image", image, "data"), ("the camera", info, "width")):
        if not (hasattr(message, "header") and hasattr(message, part)):
            kind = "Image or CompressedImage" if message is image else "CameraInfo"
            raise TypeError(f"{what} is {type(message).__name__}; expected a message {kind}")
    world_from_camera = _camera_pose(image, pose)
    seen = _pinhole(image, info, rectified)
    return seen.image, world_from_camera, seen.lens.intrinsics, stamp_of(image) / 1e9


def views_from_messages(
    images: Sequence[Any],
    infos: Sequence[Any],
    poses: Sequence[Any],
    depths: Sequence[Any] = (),
    *,
    depth_range: tuple[float, float] = INDOOR_DEPTH_RANGE,
    rectified: bool = False,
) -> Views:
    """Views for `semgs.load("small")(views)`.

    Args:
        images, infos, poses, rectified: one per view, as for `frame_from_messages`.
        depths: of each image, registered to it, as Image (16UC1 in millimetres, 0 and 65535 unknown; 32FC1 in metres) or compressedDepth; empty for none.
        depth_range: near and far [m].

    Raises:
        ValueError: as `frame_from_messages`; numbers or sizes differ; or depth is not in the frame of its image.
    """
    frames = [
        frame_from_messages(image, info, pose, rectified=rectified)
        for image, info, pose in zip(images, infos, poses, strict=True)
    ]
    pictures, cameras, intrinsics = (np.stack(parts) for parts in list(zip(*frames, strict=True))[:3])
    views = Views.from_arrays(pictures, cameras, intrinsics, depth_range)
    if not depths:
        return views
    maps = [
        _registered_depth(depth, image, info, rectified)
        for depth, image, info in zip(depths, images, infos, strict=True)
    ]
    return views.changed(depths=torch.from_numpy(np.stack(maps))).checked()


def pose_matrix(message: Any) -> Float64[np.ndarray, "4 4"]:
    """The matrix of a geometry_msgs Pose, PoseStamped, Transform or TransformStamped: takes the frame that moves to the one that the pose is given in.

    Raises:
        ValueError: a number is not finite, or the quaternion is zero, as in an empty message.
    """
    given = message
    for part in ("pose", "transform"):  # of a stamped message
        message = getattr(message, part, message)
    is_transform = hasattr(message, "rotation")
    if not (is_transform or hasattr(message, "orientation")):
        raise TypeError(
            f"a pose is {type(given).__name__}; expected a message Pose, PoseStamped, Transform or TransformStamped"
        )
    place, turn = (message.translation, message.rotation) if is_transform else (message.position, message.orientation)
    quaternion = np.array([turn.w, turn.x, turn.y, turn.z], np.float64)
    found = np.eye(4)
    found[:3, 3] = place.x, place.y, place.z
    if not (np.isfinite(found).all() and np.isfinite(quaternion).all() and np.linalg.norm(quaternion) > LEAST_NORM):
        raise ValueError(
            f"the pose has position {found[:3, 3].tolist()} and quaternion (w, x, y, z) {quaternion.tolist()}; expected finite numbers, not all 0"
        )
    found[:3, :3] = matrix_from_quaternion(torch.from_numpy(quaternion)).numpy()
    return found


def _camera_pose(image: Any, pose: Any) -> Float64[np.ndarray, "4 4"]:
    """The pose of an image's camera; a transform says of which frame it is."""
    child, camera = str(getattr(pose, "child_frame_id", "")).lstrip("/"), frame_id_of(image)
    if child and child != camera:
        raise ValueError(f"the transform is of the frame {child}; expected that of the image, {camera}")
    return pose_matrix(pose)


def _pinhole(image: Any, info: Any, rectified: bool) -> UndistortedImage:
    """An image without distortion, with its lens."""
    if is_depth(image):
        raise ValueError(f"the image in the frame {frame_id_of(image)} has depth; expected colours or grey")
    if hasattr(image, "encoding"):
        colours = np.ascontiguousarray(pixels_of(image)[..., ::-1])
    else:
        colours = decode_rgb(bytes(image.data), Path("CompressedImage"))
    height, width = colours.shape[:2]
    lens = lens_of(Path("CameraInfo"), frame_id_of(info), info, (height, width), rectified=rectified)
    maps = undistortion(lens)
    return UndistortedImage(colours if maps is None else lens.undistorted(colours, maps), lens)


def _registered_depth(depth: Any, image: Any, info: Any, rectified: bool) -> Float32[np.ndarray, "h w"]:
    """Z-depth of every pixel of an undistorted image [m], 0 where unknown."""
    if frame_id_of(depth) != frame_id_of(image):
        raise ValueError(
            f"depth is in the frame {frame_id_of(depth)}; expected {frame_id_of(image)}, registered to the image"
        )
    if not is_depth(depth):
        raise ValueError(
            f"depth in the frame {frame_id_of(depth)} has colours; expected 16UC1, 32FC1 or compressedDepth"
        )
    counts = _depth_pixels(depth)
    metres = counts * np.float32(MILLIMETRE) if counts.dtype.kind == "u" else counts
    metres = np.where(known_depths(counts), metres, 0).astype(np.float32)
    lens = lens_of(Path("CameraInfo"), frame_id_of(info), info, metres.shape, rectified=rectified)
    maps = undistortion(lens)
    return metres if maps is None else lens.undistorted(metres, maps, nearest=True)


def _depth_pixels(depth: Any) -> np.ndarray:
    """Millimetres as uint16 or metres as float32 [h w]."""
    if hasattr(depth, "encoding"):
        return pixels_of(depth)
    data = as_file(depth)
    if data[:4] == b"\x89PNG":
        counts = decode_png(data)
        if counts is None:
            raise ValueError(f"depth that is no PNG of at most {MOST_PIXELS:,} pixels")
        return counts
    return np.load(io.BytesIO(data), allow_pickle=False)


def point_cloud(scene: SavedScene, header: Any, found: Objects | None = None) -> Any:
    """A sensor_msgs/PointCloud2 with a point for each Gaussian: float32 x, y, z, rgb (packed as PCL does), label (position of the class, 255 for none) and confidence.

    Args:
        scene: such as `scene.saved` of a stream. Positions are relative to its `origin`, which is 0 in a stream.
        header: as the module says.
        found: its things; then there is also `instance`, the number of the thing, 0 for none.

    Raises:
        ImportError: rosbags is not installed.
    """
    check_type("the scene is", scene, SavedScene, "semgs.SavedScene, such as scene.saved of a stream")
    instances = None if found is None else found.instances
    return cloud_message(make_points(scene, instances), message_store().types, _header(header))


def detections(found: Objects, header: Any) -> Any:
    """A vision_msgs/Detection3DArray with a box for each thing, turned about gravity only: x is its length, y its width, z its height.

    `class_id` is the name of the class, `score` the confidence, and `id` the number of the thing.

    Args:
        found: of `semgs.objects`.
        header: as the module says.

    Raises:
        ImportError: rosbags is not installed.
    """
    check_type("things are", found, Objects, "what semgs.objects returns")
    types = message_store().types
    array = types["vision_msgs/msg/Detection3DArray"]
    return array(_header(header), [_detection(one, header, types) for one in place_things(found)])


def label_info(classes: ClassTable, header: Any, threshold: float = 0.0) -> Any:
    """A vision_msgs/LabelInfo: the name of each number in the field `label` of a cloud.

    Args:
        classes: the table.
        header: as the module says.
        threshold: the least confidence of what was published, 0..1.

    Raises:
        ImportError: rosbags is not installed.
    """
    check_type("classes are", classes, ClassTable, "a class table, such as scene.classes")
    types = message_store().types
    named = [types["vision_msgs/msg/VisionClass"](number, name) for number, name in enumerate(classes.names)]
    return types["vision_msgs/msg/LabelInfo"](_header(header), named, threshold)


def occupancy_grid(found: Occupancy, header: Any) -> Any:
    """A nav_msgs/OccupancyGrid: -1 unknown, 0 free, 100 occupied; the first row has the smallest y.

    The pose of its first corner is at the height of the floor, and turned only if `up` of `semgs.occupancy` was not z.

    Args:
        found: of `semgs.occupancy`.
        header: as the module says.

    Raises:
        ImportError: rosbags is not installed.
    """
    check_type("the map is", found, Occupancy, "what semgs.occupancy returns")
    types = message_store().types
    height, width = found.cells.shape
    frame_from_level = found.level_from_world.T
    corner = frame_from_level @ np.array([*found.origin[:2], found.floor])
    origin = _pose(corner, frame_from_level, types)
    metadata = types["nav_msgs/msg/MapMetaData"](_time(header.stamp), found.resolution, width, height, origin)
    return types["nav_msgs/msg/OccupancyGrid"](_header(header), metadata, found.cells.ravel())


def serialized(message: Any) -> bytes:
    """A message as the bytes (CDR) that rclpy's `Publisher.publish` takes, whatever distribution of ROS 2 it is from.

    Args:
        message: of one of the functions above.

    Raises:
        ImportError: rosbags is not installed.
    """
    if not hasattr(message, "__msgtype__"):
        raise TypeError(f"a message is {type(message).__name__}; expected what the other functions of semgs.ros return")
    return bytes(message_store().serialize_cdr(message, message.__msgtype__))


def _header(header: Any) -> Any:
    """A header with the same stamp and frame."""
    return message_store().types["std_msgs/msg/Header"](_time(header.stamp), str(header.frame_id))


def _time(stamp: Any) -> Any:
    """The same time."""
    return message_store().types["builtin_interfaces/msg/Time"](int(stamp.sec), int(stamp.nanosec))


def _detection(one: PlacedThing, header: Any, types: Any) -> Any:
    """A thing as Detection3D."""
    pose = _pose(one.centre, one.axes, types)
    hypothesis = types["vision_msgs/msg/ObjectHypothesis"](one.thing.name, one.thing.confidence)
    uncertain = types["geometry_msgs/msg/PoseWithCovariance"](pose, np.zeros(36))
    result = types["vision_msgs/msg/ObjectHypothesisWithPose"](hypothesis, uncertain)
    box = types["vision_msgs/msg/BoundingBox3D"](pose, types["geometry_msgs/msg/Vector3"](*one.thing.box.size))
    return types["vision_msgs/msg/Detection3D"](_header(header), [result], box, str(one.thing.instance))


def _pose(place: np.ndarray, axes: np.ndarray, types: Any) -> Any:
    """A Pose from a position and the directions of the axes in columns."""
    w, x, y, z = quaternion_from_matrix(torch.from_numpy(axes.copy())).tolist()
    point = types["geometry_msgs/msg/Point"](*place.tolist())
    return types["geometry_msgs/msg/Pose"](point, types["geometry_msgs/msg/Quaternion"](x=x, y=y, z=z, w=w))
