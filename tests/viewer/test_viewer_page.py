from __future__ import annotations

import base64
import json
import re
from dataclasses import replace

import msgspec
import numpy as np
import pytest
import torch
import zstandard
from wall_and_chair import CHAIR, wall_and_chair

from semgs.robotics.boxes import Box
from semgs.robotics.objects import Objects, Thing
from semgs.viewer.viewer_page import MOST_GAUSSIANS, scene_page


def messages(page: str) -> list[dict]:
    """What a page shows: the messages that viser's client replays."""
    data = base64.b64decode(re.search('__VISER_EMBED_DATA__="([^"]+)"', page)[1])
    inner = zstandard.ZstdDecompressor().decompressobj().decompress(data[8:])
    count = int.from_bytes(inner[:8], "little")
    return [message for _, message in msgspec.msgpack.decode(inner[8 : 8 + count])["messages"]]


def data_of(page: str) -> dict:
    """What the page's scripts know of its scene."""
    return json.loads(re.search('id="semgs">(.*?)</script>', page)[1])


def test_numbers_of_things_that_last_are_on_a_page_as_they_are():
    """All Gaussians are one thing with a number that needs more than 16 bits."""
    scene = wall_and_chair()
    box = Box((0.0, 0.0, 0.0), (1.0, 1.0, 1.0), 0.0)
    count = len(scene.gaussians)
    found = Objects((Thing(70_000, CHAIR, "chair", 0.8, box, 1.0, count),), np.full(count, 70_000), np.eye(3))
    data = data_of(scene_page(scene, [np.zeros((4, 5, 3), np.uint8)] * 2, up="z", things=found).html)
    assert set(np.frombuffer(base64.b64decode(data["things"]), "<u4").tolist()) == {70_000}
    assert data["names"] == {"70000": "chair 70000"}


def test_a_page_has_a_node_for_each_step_of_each_class_and_starts_at_the_first_photo():
    scene = wall_and_chair()
    assert scene.gaussians.semantic is not None
    features = scene.gaussians.semantic.features.reshape(2, 40, 50, -1)  # the likeliest class has 0.8
    features[:, :, 40:] = 0.45 / (features.shape[-1] - 1)
    features[:, :, 40:, CHAIR] = 0.55
    page = scene_page(scene, [np.zeros((4, 5, 3), np.uint8)] * 2, up="z").html
    found = messages(page)
    names = [message["name"] for message in found if message["type"] == "GaussianSplatsMessage"]
    assert names == [f"/{mode}/{part}" for mode in ("colour", "classes") for part in ("0/8", "1/5", "1/8")]
    data = data_of(page)
    assert [entry["name"] for entry in data["classes"]] == ["wall", "chair"]
    assert data["steps"] == [[8], [5, 8]]
    confidences = np.frombuffer(base64.b64decode(data["confidences"]), np.uint8)
    # In the order of the nodes: 2 views of 40 x 30, 40 x 10 and 40 x 10 pixels; 255 x 0.8 = 204, 255 x 0.55 = 140.25.
    assert confidences.tolist() == [204] * 2400 + [140] * 800 + [204] * 800
    visible = {
        message["name"]: message["visible"] for message in found if message["type"] == "SetSceneNodeVisibilityMessage"
    }
    assert visible["/classes"] is False
    assert visible.get("/colour", True) is True
    frusta = [message for message in found if message["type"] == "CameraFrustumMessage"]
    assert [message["name"] for message in frusta] == ["/input views/1 a-left.jpg", "/input views/2 b.jpg"]
    assert all(message["props"]["_image_data"] is not None for message in frusta)
    assert [view["node"] for view in data["views"]] == [message["name"] for message in frusta]
    assert not any(visible[message["name"]] for message in frusta), "photos would hide the scene before the script runs"
    first = next(message for message in found if message["type"] == "SetCameraPositionMessage")
    assert first["position"] == pytest.approx((4.0, 8.0, 6.0))


def test_a_page_is_named_after_its_scene_as_text():
    page = scene_page(replace(wall_and_chair((4, 5)), source="<b>wall</b></script>")).html
    assert "<title>&lt;b&gt;wall&lt;/b&gt;&lt;/script&gt;</title>" in page
    assert data_of(page)["title"] == "<b>wall</b></script>"


def test_a_page_knows_how_exact_positions_are():
    """A thousandth of 0.0025 units, the median depth, is 2.5e-6: six digits after the point."""
    page = scene_page(replace(wall_and_chair((4, 5), scale=0.001), unit="unknown"))
    assert data_of(page.html)["decimals"] == page.decimals == 6


def test_a_page_of_a_scene_without_classes_has_no_group_of_classes():
    page = scene_page(wall_and_chair((4, 5), classes=False)).html
    names = {message["name"] for message in messages(page) if message["type"] == "GaussianSplatsMessage"}
    assert all(name.startswith("/colour/0/") for name in names)
    assert data_of(page)["classes"] == []


def test_a_thinned_page_has_the_gaussians_that_cover_most():
    """Only the last ten columns of the last row cover anything. They are of the chair."""
    scene = wall_and_chair()
    scene.gaussians.opacities[:-10] = 0
    names = [
        message["name"]
        for message in messages(scene_page(scene, at_most=10).html)
        if message["type"] == "GaussianSplatsMessage"
    ]
    assert names == ["/colour/0/8", "/classes/0/8"]
    assert scene_page(scene, at_most=10).shown == 10


@pytest.mark.long
def test_a_page_of_two_views_has_all_gaussians_and_at_most_12_mb():
    """With a Gaussian for each pixel, and random numbers: nothing compresses worse."""
    scene = wall_and_chair((240, 320))
    draw = torch.Generator().manual_seed(1)
    for tensor in (scene.gaussians.means, scene.gaussians.colour.scales, scene.gaussians.semantic.scales):
        tensor[:] = torch.rand(tensor.shape, generator=draw) + 0.1
    for shape in (scene.gaussians.colour, scene.gaussians.semantic):
        shape.quaternions[:] = torch.nn.functional.normalize(
            torch.randn(shape.quaternions.shape, generator=draw), dim=-1
        )
    scene.gaussians.opacities[:] = torch.rand(len(scene.gaussians), generator=draw)
    scene.gaussians.colour.features[:] = torch.rand(scene.gaussians.colour.features.shape, generator=draw)
    scene.gaussians.semantic.features[:] = torch.rand(scene.gaussians.semantic.features.shape, generator=draw).softmax(
        -1
    )
    photo = np.random.default_rng(1).integers(0, 256, (240, 320, 3), np.uint8)
    page = scene_page(scene, [photo, photo])
    assert page.shown == len(scene.gaussians) == MOST_GAUSSIANS
    assert len(page.html.encode()) <= 12_000_000
