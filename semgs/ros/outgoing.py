"""Messages out: points, things, class names and free floor, as rosbags' types of ROS 2.

`header` is any object with `stamp` and `frame_id`, such as the header of the latest transform; every message has the same. Positions are in the frame of the poses that the scene was made
with.
"""

from __future__ import annotations

from typing import Any

import numpy as np
import torch

from semgs.data.tables.classes import ClassTable
from semgs.export.points import cloud_message, make_points
from semgs.export.scene_objects import PlacedThing, place_things
from semgs.files.bags import message_store
from semgs.geometry.rotations import quaternion_from_matrix
from semgs.robotics.objects import Objects
from semgs.robotics.occupancy import Occupancy
from semgs.runtime.argument_types import check_type
from semgs.scene.scene_file import SavedScene


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
