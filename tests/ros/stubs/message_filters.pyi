from collections.abc import Callable, Sequence
from typing import Any

from rclpy.node import Node
from rclpy.qos import QoSProfile

class Subscriber:
    def __init__(self, node: Node, msg_type: type, topic: str, *, qos_profile: QoSProfile) -> None: ...

class TimeSynchronizer:
    def __init__(self, fs: Sequence[Subscriber], queue_size: int) -> None: ...
    def registerCallback(self, cb: Callable[..., Any]) -> int: ...
