"""Messages of ROS 2, in and out, without ROS (extra `ros`: rosbags).

    from semgs import ros

    scenes = semgs.stream(ros.frame_from_messages(image, info, transform) for image, info, transform in messages)

Messages that come in may be from rclpy, rosbags or anything else with the same attributes. Messages that go out are of rosbags' types; `serialized` gives the bytes that rclpy
publishes. Cameras come in as optical frames (x right, y down, z forward, as OpenCV). What goes out is in the frame of the poses, which should have z up, such as `map`, `odom` or
`base_link`: its header is that of the pose or transform, with its `frame_id` and `stamp`.
"""

from semgs.ros.messages import (
    PosedImage,
    detections,
    frame_from_messages,
    label_info,
    occupancy_grid,
    point_cloud,
    pose_matrix,
    serialized,
    views_from_messages,
)

__all__ = [
    "PosedImage", "detections", "frame_from_messages", "label_info", "occupancy_grid", "point_cloud", "pose_matrix", "serialized", "views_from_messages",
]  # fmt: skip
