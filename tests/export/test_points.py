"""Point clouds, read by other programs."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
import torch
from known import CHAIR, SIZE, WALL, plane_scene

from semgs.data.tables.classes import SCANNET20
from semgs.export.gltf import save_gltf
from semgs.export.ply import save_semantic_ply
from semgs.export.points import FRAME, TOPIC, make_points, save_bag, save_points
from semgs.geometry.harmonics import basis
from semgs.scene.confidence import selected
from semgs.scene.own_views import own_labels
from semgs.splats.load import load_splat


def test_a_point_has_the_colour_that_its_own_camera_sees_and_its_likeliest_class() -> None:
    scene = plane_scene()
    points, second = make_points(scene), SIZE[0] * SIZE[1] + 5  # a pixel of the second view
    way = scene.gaussians.means[second] - scene.cameras.centres[1].float()
    colour = 0.5 + basis(way / way.norm(), 2) @ scene.gaussians.colour.features[second]
    assert points.colours[second].tolist() == (255 * colour.clamp(0, 1)).round().tolist()
    assert points.labels is not None
    assert points.labels[: SIZE[1]].unique().tolist() == sorted({WALL, CHAIR, 6})
    assert points.confidences.allclose(torch.tensor(0.8))
    assert make_points(plane_scene(classes=False)).confidences.allclose(torch.tensor(0.75))


def test_trimesh_reads_positions_colours_and_scalar_fields(tmp_path: Path) -> None:
    trimesh = pytest.importorskip("trimesh")
    points = make_points(plane_scene())
    save_points(tmp_path / "points.ply", points)
    cloud = trimesh.load(tmp_path / "points.ply")
    assert np.array_equal(cloud.vertices.astype(np.float32), points.means.numpy())
    assert np.array_equal(cloud.colors[:, :3], points.colours.numpy())
    raw = cloud.metadata["_ply_raw"]["vertex"]["data"]
    assert raw.dtype.names == ("x", "y", "z", "red", "green", "blue", "scalar_label", "scalar_confidence")
    assert np.array_equal(raw["scalar_label"].ravel(), points.labels)
    assert np.array_equal(raw["scalar_confidence"].ravel(), points.confidences.numpy())


def test_without_classes_there_is_no_label(tmp_path: Path) -> None:
    save_points(tmp_path / "points.ply", make_points(plane_scene(classes=False)))
    header = (tmp_path / "points.ply").read_bytes().partition(b"end_header")[0]
    assert b"scalar_label" not in header
    assert header.endswith(b"property float scalar_confidence\n")


def test_the_reference_library_of_mcap_reads_one_latched_cloud(tmp_path: Path) -> None:
    reader = pytest.importorskip("mcap.reader")
    pytest.importorskip("rosbags")
    points = make_points(plane_scene())
    save_bag(tmp_path / "points.mcap", points)
    assert [path.name for path in tmp_path.iterdir()] == ["points.mcap"]
    with (tmp_path / "points.mcap").open("rb") as file:
        ((schema, channel, message),) = reader.make_reader(file, validate_crcs=True).iter_messages()
    assert (schema.name, schema.encoding) == ("sensor_msgs/msg/PointCloud2", "ros2msg")
    assert (channel.topic, channel.message_encoding) == (TOPIC, "cdr")
    assert "durability: 1" in channel.metadata["offered_qos_profiles"]  # transient local
    # CDR: four bytes of encapsulation, then sec, nanosec, frame_id; x y z rgb label confidence take 24 bytes a point.
    data = message.data
    assert data[4:12] == (1).to_bytes(4, "little") + bytes(4)
    assert data[16:20] == FRAME.encode() + b"\0"
    body = np.frombuffer(data[-1 - 24 * len(points) : -1], "<f4").reshape(-1, 6)  # the last byte is is_dense
    assert data[-1] == 1
    assert np.array_equal(body[:, :3], points.means.numpy())
    assert np.array_equal(body[:, 4], points.labels)
    packed = body[:, 3].copy().view("<u4")
    assert np.array_equal(np.stack((packed >> 16, packed >> 8 & 255, packed & 255), -1), points.colours.numpy())


def test_rosbags_reads_the_fields_that_rviz_looks_for(tmp_path: Path) -> None:
    highlevel = pytest.importorskip("rosbags.highlevel")
    points = make_points(plane_scene()).only(torch.arange(2 * SIZE[0] * SIZE[1]) % 3 == 0)
    save_bag(tmp_path / "points.mcap", points)
    with highlevel.AnyReader([tmp_path / "points.mcap"]) as bag:
        ((connection, _, data),) = bag.messages()
        cloud = bag.deserialize(data, connection.msgtype)
    assert [(field.name, field.offset, field.datatype) for field in cloud.fields] == [
        ("x", 0, 7), ("y", 4, 7), ("z", 8, 7), ("rgb", 12, 7), ("label", 16, 7), ("confidence", 20, 7),
    ]  # fmt: skip
    assert (cloud.width, cloud.height, cloud.point_step, cloud.row_step) == (len(points), 1, 24, 24 * len(points))
    assert cloud.header.frame_id == "map"


def test_equal_scenes_give_equal_files(tmp_path: Path) -> None:
    pytest.importorskip("rosbags")
    points = make_points(plane_scene())
    for name in ("a", "b"):
        (tmp_path / name).mkdir()
        save_points(tmp_path / name / "points.ply", points)
        save_bag(tmp_path / name / "points.mcap", points)
    for name in ("points.ply", "points.mcap"):
        assert (tmp_path / "a" / name).read_bytes() == (tmp_path / "b" / name).read_bytes()


def test_gaussians_without_a_class_have_none_in_any_file_and_belong_to_no_class(tmp_path: Path) -> None:
    """Of 28 columns the first 10 are wall, in 20 rows of two views: 400. The first view loses its classes: 200 walls stay, and 560 Gaussians have no class."""
    scene = plane_scene()
    assert scene.gaussians.semantic is not None
    shares = scene.gaussians.semantic.features.clone()
    assert int((shares.argmax(-1) == WALL).sum()) == 400
    shares[:560] = 1 / 20
    semantic = replace(scene.gaussians.semantic, features=shares)
    scene = replace(scene, gaussians=replace(scene.gaussians, semantic=semantic))
    labels = make_points(scene).labels
    assert labels is not None
    assert (int((labels == 255).sum()), int((labels == WALL).sum())) == (560, 200)
    assert int(selected(scene, classes=("wall",)).sum()) == 200
    save_gltf(tmp_path / "a.glb", scene)
    numbers = load_splat(tmp_path / "a.glb").extra["_CLASS"]
    assert ((numbers == 255).sum(), (numbers == WALL).sum()) == (560, 200)
    save_semantic_ply(tmp_path / "a.ply", scene.gaussians, SCANNET20)
    colours = 0.5 + 0.28209479177387814 * load_splat(tmp_path / "a.ply").gaussians.colour.features[:, 0]
    grey = (colours * 255 - torch.tensor([212.0, 212.0, 214.0])).abs().amax(-1) < 0.01
    assert grey.tolist() == [True] * 560 + [False] * 560
    assert (own_labels(scene)[0] == 255).all()
