"""A ROS 2 node that maps with a posed camera. Not yet run under ROS: tests check its types and run it on a stand-in.

python examples/ros2_node.py --ros-args -r image:=/camera/image_rect -r camera_info:=/camera/camera_info -p world:=map"""

from collections.abc import Iterator
from contextlib import suppress
from queue import Empty, Queue

import rclpy
from message_filters import Subscriber, TimeSynchronizer
from rclpy.duration import Duration
from rclpy.qos import qos_profile_sensor_data as best_effort
from rclpy.time import Time
from sensor_msgs.msg import CameraInfo, Image, PointCloud2
from tf2_ros import Buffer, TransformListener
from vision_msgs.msg import Detection3DArray

import semgs
from semgs import ros

rclpy.init()
node, buffer, headers = rclpy.create_node("semgs"), Buffer(), list[object]()
world, listener = node.declare_parameter("world", "map").value, TransformListener(buffer, node, spin_thread=True)
points, things = node.create_publisher(PointCloud2, "points", 1), node.create_publisher(Detection3DArray, "things", 1)
pairs: Queue[tuple[Image, CameraInfo]] = Queue(maxsize=1)  # images that come while one is worked on are skipped
images = Subscriber(node, Image, "image", qos_profile=best_effort)  # receives what is published as reliable, too
camera = TimeSynchronizer([images, Subscriber(node, CameraInfo, "camera_info", qos_profile=best_effort)], 10)
camera.registerCallback(lambda image, info: None if pairs.full() else pairs.put((image, info)))


def frames() -> Iterator[ros.PosedImage]:
    """Each image with its pose in the world, which tf may give up to half a second later; others are skipped. SIGTERM ends them."""
    while rclpy.ok():
        try:
            image, info = pairs.get(timeout=0.5)
        except Empty:
            continue
        time = Time.from_msg(image.header.stamp)
        if buffer.can_transform(world, image.header.frame_id, time, Duration(seconds=0.5)):
            pose = buffer.lookup_transform(world, image.header.frame_id, time)
            headers[:] = [pose.header]
            yield ros.frame_from_messages(image, info, pose, rectified=True)


with suppress(KeyboardInterrupt):
    for scene in semgs.stream(frames(), radius=5.0):
        points.publish(ros.serialized(ros.point_cloud(scene.saved, headers[0])))
        things.publish(ros.serialized(ros.detections(semgs.objects(scene.gaussians), headers[0])))
