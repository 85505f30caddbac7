"""ROS bags by the library rosbags (extra `ros`); ROS is not needed."""

from __future__ import annotations

from collections.abc import Callable
from functools import cache
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

from semgs.files.extras import needs_extra

VISION = {
    "BoundingBox3D": "geometry_msgs/Pose center\ngeometry_msgs/Vector3 size",
    "Detection3D": "std_msgs/Header header\nObjectHypothesisWithPose[] results\nBoundingBox3D bbox\nstring id",
    "Detection3DArray": "std_msgs/Header header\nDetection3D[] detections",
    "LabelInfo": "std_msgs/Header header\nVisionClass[] class_map\nfloat32 threshold",
    "ObjectHypothesis": "string class_id\nfloat64 score",
    "ObjectHypothesisWithPose": "ObjectHypothesis hypothesis\ngeometry_msgs/PoseWithCovariance pose",
    "VisionClass": "uint16 class_id\nstring class_name",
}
"""Definitions of vision_msgs 4 (https://github.com/ros-perception/vision_msgs, branch ros2), which rosbags does not have."""


def bag_reader(path: Path) -> Any:
    """rosbags' reader of a bag, not yet opened. Messages without types have those of the newest ROS 2.

    Raises:
        ImportError: rosbags is not installed.
    """
    with needs_extra("ros", f"{path} is a ROS bag; reading it needs rosbags", "rosbags"):
        from rosbags.highlevel import AnyReader
        from rosbags.typesys import Stores, get_typestore
    return AnyReader([path], default_typestore=get_typestore(Stores.LATEST))


@cache
def message_store() -> Any:
    """rosbags' types of ROS 2 and vision_msgs, which make, serialise and read messages. It is shared: register nothing.

    Raises:
        ImportError: rosbags is not installed.
    """
    with needs_extra("ros", "messages of ROS need rosbags", "rosbags"):
        from rosbags.typesys import Stores, get_types_from_msg, get_typestore
    store = get_typestore(Stores.ROS2_HUMBLE)
    for name, definition in VISION.items():
        store.register(get_types_from_msg(definition, f"vision_msgs/msg/{name}"))
    return store


def check_bag_library() -> None:
    """Check that bags can be written.

    Raises:
        ImportError: rosbags is not installed.
    """
    with needs_extra("ros", "writing a ROS bag needs rosbags", "rosbags"):
        import rosbags.rosbag2  # noqa: F401


def write_message(path: Path, topic: str, time: int, message: Callable[[dict[str, Any]], Any]) -> None:
    """Write a bag of ROS 2 with one message, as one `.mcap` file. Subscribers that come later get the message too.

    Args:
        path: the file.
        topic: of the message.
        time: when it was recorded [ns].
        message: makes the message from the classes of all types, by their names, such as "std_msgs/msg/Header".

    Raises:
        ImportError: rosbags is not installed.
        OSError: it cannot be written.
    """
    check_bag_library()
    from rosbags import interfaces as ros
    from rosbags.rosbag2 import StoragePlugin, Writer

    store = message_store()
    made = message(store.types)
    never = ros.QosTime(0, 0)
    latched = ros.Qos(
        ros.QosHistory.KEEP_LAST, 1, ros.QosReliability.RELIABLE, ros.QosDurability.TRANSIENT_LOCAL, never, never,
        ros.QosLiveliness.AUTOMATIC, never, False,
    )  # fmt: skip
    with TemporaryDirectory(dir=path.parent, prefix=f".{path.name}.") as folder:
        bag = Path(folder) / path.stem
        with Writer(bag, version=8, storage_plugin=StoragePlugin.MCAP) as writer:
            connection = writer.add_connection(topic, made.__msgtype__, typestore=store, offered_qos_profiles=[latched])
            writer.write(connection, time, store.serialize_cdr(made, made.__msgtype__))
        (bag / f"{bag.name}.mcap").replace(path)
