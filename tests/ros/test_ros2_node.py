"""examples/ros2_node.py: its types against stubs of ROS's Python packages, and a run on a stand-in for them."""

from __future__ import annotations

import os
import runpy
import subprocess
import sys
from array import array
from collections import defaultdict
from collections.abc import Callable
from pathlib import Path
from types import ModuleType, SimpleNamespace
from typing import Any

import numpy as np
import pytest
import torch

import semgs
from semgs.data.demo_scene import demo_scene
from semgs.data.resampling import resized
from semgs.data.scenes import open_scene
from semgs.figures.view_images import as_bytes
from semgs.files.bags import message_store
from semgs.geometry.rotations import quaternion_from_matrix

ROOT = Path(__file__).resolve().parents[2]
NODE = ROOT / "examples" / "ros2_node.py"
STUBS = Path(__file__).parent / "stubs"


def types_of(script: Path, cache: Path) -> subprocess.CompletedProcess[str]:
    """What mypy says about a script, with the stubs and our functions for messages; all else is not looked at."""
    ours = [ROOT / "semgs" / "ros" / name for name in ("__init__.py", "messages.py")]
    options = ["--config-file=", "--follow-imports=skip", "--check-untyped-defs", "--disallow-untyped-defs"]
    return subprocess.run(
        [sys.executable, "-m", "mypy", *options, "--cache-dir", cache, script, *ours, *sorted(STUBS.rglob("*.pyi"))],
        capture_output=True, text=True, check=False, cwd=ROOT, env=os.environ | {"MYPYPATH": f"{STUBS}:{ROOT}"}, timeout=200,
    )  # fmt: skip


@pytest.mark.long
def test_the_types_of_the_node_fit_those_of_ros_and_planted_mistakes_are_found(tmp_path: Path) -> None:
    pytest.importorskip("mypy")
    good = types_of(NODE, tmp_path / "cache")
    assert good.returncode == 0, good.stdout
    text, planted = NODE.read_text(), tmp_path / "planted.py"
    mistakes = {
        "points.publish(ros.serialized(": "points.publish(len(",
        "Duration(seconds=0.5)": "0.5",
        "Time.from_msg(image.header.stamp)": "Time.from_msg(image.header)",
        "ros.frame_from_messages(image": "ros.frame_from_message(image",
        "spin_thread": "thread",
    }
    for right, wrong in mistakes.items():
        assert text.count(right) == 1
        text = text.replace(right, wrong)
    planted.write_text(text)
    found = types_of(planted, tmp_path / "cache").stdout
    assert found.count("error:") == len(mistakes), found


class StandIn:
    """What the node uses of ROS. When it starts, a camera publishes the first photos of the included room; tf does not know the pose of the second.

    Attributes:
        published: the messages by topic, as bytes.
        runs: until ROS is shut down.
        heard_as: the quality of service of each subscription.
    """

    def __init__(self, count: int = 4, size: tuple[int, int] = (120, 160)) -> None:
        self.views = resized(open_scene(demo_scene()).read(range(count), "native"), size)
        self.published: dict[str, list[bytes]] = defaultdict(list)
        self.runs, self.heard_as = True, list[str]()

    def modules(self) -> dict[str, ModuleType]:
        """The packages of ROS, by name."""
        kinds = {name: type(name, (), {}) for name in ("Image", "CameraInfo", "PointCloud2", "Detection3DArray")}
        inside = {
            "rclpy": {"init": lambda: None, "create_node": lambda _: self, "ok": lambda: self.runs},
            "rclpy.duration": {"Duration": lambda seconds: seconds},
            "rclpy.time": {"Time": SimpleNamespace(from_msg=lambda stamp: stamp)},
            "rclpy.qos": {"qos_profile_sensor_data": "best effort"},
            "message_filters": {"Subscriber": lambda *_, qos_profile: self.heard_as.append(qos_profile), "TimeSynchronizer": lambda *_: self},
            "sensor_msgs.msg": kinds, "vision_msgs.msg": kinds,
            "tf2_ros": {"Buffer": lambda: self, "TransformListener": lambda *_, spin_thread: None},
        }  # fmt: skip
        found = {}
        for name, members in inside.items():
            found[name] = ModuleType(name)
            vars(found[name]).update(members)
            found.setdefault(name.partition(".")[0], ModuleType(name.partition(".")[0]))
        return found

    def declare_parameter(self, name: str, value: str) -> SimpleNamespace:
        assert name == "world"
        return SimpleNamespace(value=value)

    def create_publisher(self, _: type, topic: str, __: int) -> SimpleNamespace:
        return SimpleNamespace(publish=self.published[topic].append)

    def registerCallback(self, callback: Callable[..., Any]) -> None:
        """Take what images are given to, and publish the first."""
        self.callback, self.next = callback, 0
        self.publish_image()

    def publish_image(self) -> None:
        """Give the next image to the node; after the last one, shut ROS down, as its handler of SIGTERM does."""
        if self.next == len(self.views):
            self.runs = False
            return
        height, width = self.views.size
        k = self.views.cameras.intrinsics[self.next].numpy() - 0.5 * np.array([[0, 0, 1], [0, 0, 1], [0, 0, 0]])
        header = SimpleNamespace(stamp=SimpleNamespace(sec=self.next + 1, nanosec=5), frame_id="optical")
        pixels = as_bytes(self.views.images[self.next])
        image = SimpleNamespace(
            header=header, height=height, width=width, encoding="rgb8", is_bigendian=0, step=3 * width, data=array("B", pixels.tobytes())
        )  # fmt: skip
        info = SimpleNamespace(
            header=header, height=height, width=width, distortion_model="plumb_bob", d=array("d"), k=k.ravel(),
            p=np.hstack((k, np.zeros((3, 1)))).ravel(), binning_x=0, binning_y=0,
            roi=SimpleNamespace(x_offset=0, y_offset=0, height=0, width=0),
        )  # fmt: skip
        self.next += 1
        self.callback(image, info)

    def can_transform(self, target: str, source: str, stamp: SimpleNamespace, timeout: float) -> bool:
        """All but the second; then the camera goes on."""
        assert (target, source, timeout) == ("map", "optical", 0.5)
        self.publish_image()
        return stamp.sec != 2

    def lookup_transform(self, target: str, source: str, stamp: SimpleNamespace) -> SimpleNamespace:
        pose = self.views.cameras.world_from_camera[stamp.sec - 1]
        w, x, y, z = quaternion_from_matrix(pose[:3, :3]).tolist()
        place = dict(zip("xyz", pose[:3, 3].tolist(), strict=True))
        moved = SimpleNamespace(translation=SimpleNamespace(**place), rotation=SimpleNamespace(x=x, y=y, z=z, w=w))
        return SimpleNamespace(
            header=SimpleNamespace(stamp=stamp, frame_id=target), child_frame_id=source, transform=moved
        )


def test_on_a_stand_in_for_ros_the_node_publishes_the_room_with_the_stamp_of_its_latest_image(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    pytest.importorskip("sklearn")
    robot = StandIn()
    for name, module in robot.modules().items():
        monkeypatch.setitem(sys.modules, name, module)
    runpy.run_path(str(NODE))
    read = message_store().deserialize_cdr
    clouds = [read(data, "sensor_msgs/msg/PointCloud2") for data in robot.published["points"]]
    things = [read(data, "vision_msgs/msg/Detection3DArray") for data in robot.published["things"]]
    assert clouds
    assert robot.heard_as == ["best effort", "best effort"]
    for messages in (clouds, things):
        assert {message.header.frame_id for message in messages} == {"map"}
        assert {message.header.stamp.sec for message in messages} <= {3, 4}  # the first window has frames 1 and 3
    # tf knows the poses of the first, third and fourth image; the mapping of these alone gives the same points.
    seen, given = robot.views, [0, 2, 3]
    images = torch.from_numpy(np.stack([as_bytes(seen.images[one]) for one in given])).movedim(-1, 1) / 255
    cameras = seen.cameras[given]
    *_, last = semgs.stream(zip(images, cameras.world_from_camera, cameras.intrinsics, strict=True), radius=5.0)
    rows = [cloud.data.view("<f4").reshape(cloud.width, -1) for cloud in clouds]
    assert things[-1].detections
    for row, message in zip(rows, things, strict=True):  # the last column is `instance`
        assert set(row[:, -1].astype(int)) - {0} == {int(one.id) for one in message.detections}
    points = rows[-1][:, :3]
    np.testing.assert_allclose(points, last.gaussians.means.numpy(), atol=1e-3)
    assert np.abs(np.median(points, 0) - (0.06, 1.26, 0.42)).max() < 0.5  # of their true depths
