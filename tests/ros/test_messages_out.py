"""Messages out, written to an MCAP bag and read back from the definitions in the bag."""

from __future__ import annotations

import io
from dataclasses import replace
from math import cos, radians, sin, sqrt
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from PIL import Image
from rosbags.highlevel import AnyReader
from rosbags.rosbag2 import StoragePlugin, Writer
from wall_and_chair import CHAIR, wall_and_chair

from semgs import ros
from semgs.data.tables.classes import SCANNET20
from semgs.export.map_files import map_image
from semgs.files.bags import message_store
from semgs.robotics.boxes import Box
from semgs.robotics.floor import level_from_world
from semgs.robotics.objects import Objects, Thing
from semgs.robotics.occupancy import FREE, OCCUPIED, UNKNOWN, Occupancy

HEADER = SimpleNamespace(stamp=SimpleNamespace(sec=7, nanosec=500), frame_id="base_link")
CELLS = np.array([[FREE, OCCUPIED, UNKNOWN, FREE], [OCCUPIED, OCCUPIED, FREE, UNKNOWN]], np.int8)


def read_back(folder: Path, message: Any) -> Any:
    """A message as a bag gives it back."""
    store = message_store()
    with Writer(folder / "bag", version=8, storage_plugin=StoragePlugin.MCAP) as writer:
        connection = writer.add_connection("/semgs", message.__msgtype__, typestore=store)
        writer.write(connection, 7_000_000_500, store.serialize_cdr(message, message.__msgtype__))
    with AnyReader([folder / "bag"]) as bag:
        ((connection, _, data),) = bag.messages()
        assert connection.msgtype == message.__msgtype__
        assert ros.serialized(message) == bytes(data)
        return bag.deserialize(data, connection.msgtype)


def check_header(message: Any) -> None:
    """The header is that of the input."""
    assert (message.header.stamp.sec, message.header.stamp.nanosec, message.header.frame_id) == (7, 500, "base_link")


def things(level: np.ndarray) -> Objects:
    """A chair in a box of 0.6 x 0.5 x 0.9 m, turned by 30 degrees, and a table."""
    chair = Thing(1, CHAIR, "chair", 0.75, Box((1.5, -0.25, 0.45), (0.6, 0.5, 0.9), radians(30)), 1.1, 3)
    table = Thing(2, 6, "table", 0.5, Box((3.0, 1.0, 0.4), (1.2, 0.8, 0.8), 0.0), 2.5, 2)
    return Objects((chair, table), np.array([1, 0, 1, 2, 1, 2]), level)


def plan(level: np.ndarray) -> Occupancy:
    voxels = CELLS[None].copy()
    return Occupancy(CELLS, voxels, np.full(voxels.shape, 255, np.uint8), (-1.25, 2.5, -0.1), 0.05, 0.02, level)


def test_a_cloud_has_position_colour_class_and_confidence_of_each_gaussian(tmp_path: Path):
    scene = replace(wall_and_chair(), origin=(0.0, 0.0, 0.0))
    found = Objects((), (np.arange(len(scene.gaussians)) % 3).astype(np.int64), np.eye(3))
    cloud = read_back(tmp_path, ros.point_cloud(scene, HEADER, found))
    check_header(cloud)
    fields = [(field.name, field.offset, field.datatype, field.count) for field in cloud.fields]
    names = ("x", "y", "z", "rgb", "label", "confidence", "instance")
    assert fields == [(name, 4 * place, 7, 1) for place, name in enumerate(names)]
    assert (cloud.height, cloud.width, cloud.point_step, cloud.row_step) == (1, 4000, 28, 112_000)
    assert (cloud.is_bigendian, cloud.is_dense) == (False, True)
    rows = cloud.data.view("<f4").reshape(4000, 7)
    np.testing.assert_array_equal(rows[:, :3], scene.gaussians.means.numpy())
    # The last pixel of the first row shows the green chair, (0.1, 0.7, 0.2) of 255.
    packed = int(rows[49, 3].view("<u4"))
    assert (packed >> 16, packed >> 8 & 255, packed & 255) == pytest.approx((26, 178, 51), abs=1)
    assert rows[49, 4:].tolist() == pytest.approx([CHAIR, 0.8, 49 % 3])
    assert [field.name for field in ros.point_cloud(scene, HEADER).fields] == list(names[:6])


def test_detections_are_boxes_with_names_in_the_frame_of_the_poses(tmp_path: Path):
    message = read_back(tmp_path, ros.detections(things(np.eye(3)), HEADER))
    check_header(message)
    chair, table = message.detections
    check_header(chair)
    assert (chair.id, table.id) == ("1", "2")
    (result,) = chair.results
    assert (result.hypothesis.class_id, result.hypothesis.score) == ("chair", 0.75)
    for pose in (chair.bbox.center, result.pose.pose):
        assert (pose.position.x, pose.position.y, pose.position.z) == pytest.approx((1.5, -0.25, 0.45))
        turn = pose.orientation  # 30 degrees about z
        assert (turn.x, turn.y, turn.z, turn.w) == pytest.approx((0, 0, sin(radians(15)), cos(radians(15))))
    assert not result.pose.covariance.any()
    assert (chair.bbox.size.x, chair.bbox.size.y, chair.bbox.size.z) == (0.6, 0.5, 0.9)


def test_if_y_is_down_boxes_and_plan_are_turned_into_the_frame_of_the_poses(tmp_path: Path):
    level = level_from_world((0.0, -1.0, 0.0))  # x stays, -y becomes z, z becomes y
    np.testing.assert_allclose(level, [[1, 0, 0], [0, 0, 1], [0, -1, 0]], atol=1e-15)
    centre = ros.detections(things(level), HEADER).detections[0].bbox.center.position
    assert (centre.x, centre.y, centre.z) == pytest.approx((1.5, -0.45, -0.25))
    origin = read_back(tmp_path, ros.occupancy_grid(plan(level), HEADER)).info.origin
    assert (origin.position.x, origin.position.y, origin.position.z) == pytest.approx((-1.25, -0.02, 2.5))
    turn = origin.orientation  # takes z to -y: a quarter turn about x
    assert (turn.x, turn.y, turn.z, turn.w) == pytest.approx((sqrt(0.5), 0, 0, sqrt(0.5)))


def test_class_names_are_those_of_the_numbers(tmp_path: Path):
    message = read_back(tmp_path, ros.label_info(SCANNET20, HEADER, threshold=0.5))
    check_header(message)
    assert [(one.class_id, one.class_name) for one in message.class_map] == list(enumerate(SCANNET20.names))
    assert message.threshold == 0.5


def test_the_grid_is_that_of_the_plan_cell_for_cell_and_the_map_turned_upside_down(tmp_path: Path):
    message = read_back(tmp_path, ros.occupancy_grid(plan(np.eye(3)), HEADER))
    check_header(message)
    assert message.data.tolist() == [0, 100, -1, 0, 100, 100, 0, -1]  # the row with the smallest y first
    about = message.info
    assert (about.width, about.height, about.map_load_time.sec, about.map_load_time.nanosec) == (4, 2, 7, 500)
    assert about.resolution == pytest.approx(0.05)
    place, turn = about.origin.position, about.origin.orientation
    assert (place.x, place.y, place.z, turn.x, turn.y, turn.z, turn.w) == (-1.25, 2.5, 0.02, 0, 0, 0, 1)
    pixels = np.asarray(Image.open(io.BytesIO(map_image(CELLS)))).astype(int)
    grid = message.data.reshape(2, 4)
    np.testing.assert_array_equal(np.select([pixels == 0, pixels == 254], [100, 0], -1)[::-1], grid)


def test_without_rosbags_the_extra_is_named(monkeypatch: pytest.MonkeyPatch):
    message_store.cache_clear()
    monkeypatch.setitem(__import__("sys").modules, "rosbags.typesys", None)
    with pytest.raises(ImportError, match=r"need rosbags: pip install -e '\.\[ros\]'"):
        ros.label_info(SCANNET20, HEADER)
