"""Map with a posed camera: python examples/ros2_node.py --ros-args -r image:=/camera/image_rect -p world:=map"""

from collections.abc import Iterator
from contextlib import suppress
from queue import Empty, Queue

import rclpy
from message_filters import Subscriber, TimeSynchronizer
from rclpy.duration import Duration
from rclpy.qos import qos_profile_sensor_data as qos  # also hears what is published as reliable
from rclpy.time import Time
from sensor_msgs.msg import CameraInfo, Image, PointCloud2
from tf2_ros import Buffer, TransformListener
from vision_msgs.msg import Detection3DArray

from semgs import Ids, objects, ros, stream

rclpy.init()
node, buffer, headers, ids = rclpy.create_node("semgs"), Buffer(), list[object](), Ids()
world, listener = node.declare_parameter("world", "map").value, TransformListener(buffer, node, spin_thread=True)
points, things = node.create_publisher(PointCloud2, "points", 1), node.create_publisher(Detection3DArray, "things", 1)
pairs: Queue[tuple[Image, CameraInfo]] = Queue(maxsize=1)  # images that come while one is worked on are skipped
subs = [Subscriber(node, Image, "image", qos_profile=qos), Subscriber(node, CameraInfo, "camera_info", qos_profile=qos)]
TimeSynchronizer(subs, 10).registerCallback(lambda image, info: None if pairs.full() else pairs.put((image, info)))


def frames() -> Iterator[ros.PosedImage]:
    """Each image with its pose in the world, if tf gives it within half a second, until Ctrl-C or SIGTERM."""
    while rclpy.ok():
        with suppress(Empty, KeyboardInterrupt):
            image, info = pairs.get(timeout=0.5)
            time = Time.from_msg(image.header.stamp)
            if buffer.can_transform(world, image.header.frame_id, time, Duration(seconds=0.5)):
                headers[:] = [(pose := buffer.lookup_transform(world, image.header.frame_id, time)).header]
                yield ros.frame_from_messages(image, info, pose, rectified=True)


for scene in stream(frames(), radius=5.0):
    found = ids.update(objects(scene.gaussians), scene.gaussians, scene.sources)
    points.publish(ros.serialized(ros.point_cloud(scene.saved, headers[0], found)))
    things.publish(ros.serialized(ros.detections(found, headers[0])))
