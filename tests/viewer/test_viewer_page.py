from __future__ import annotations

import base64
import re
from dataclasses import replace

import msgspec
import numpy as np
import pytest
import torch
import zstandard
from wall_and_chair import wall_and_chair

from semgs.viewer.viewer_page import MOST_GAUSSIANS, scene_page


def messages(page: str) -> list[dict]:
    """What a page shows: the messages that viser's client replays."""
    data = base64.b64decode(re.search('__VISER_EMBED_DATA__="([^"]+)"', page)[1])
    inner = zstandard.ZstdDecompressor().decompressobj().decompress(data[8:])
    count = int.from_bytes(inner[:8], "little")
    return [message for _, message in msgspec.msgpack.decode(inner[8 : 8 + count])["messages"]]


def test_a_page_has_a_node_for_each_class_named_by_it_and_starts_at_the_first_photo():
    scene = wall_and_chair()
    found = messages(scene_page(scene, [np.zeros((4, 5, 3), np.uint8)] * 2, up="z"))
    names = [message["name"] for message in found if message["type"] == "GaussianSplatsMessage"]
    assert names == ["/colour/wall", "/colour/chair", "/classes/wall", "/classes/chair"]
    visible = {
        message["name"]: message["visible"] for message in found if message["type"] == "SetSceneNodeVisibilityMessage"
    }
    assert visible["/classes"] is False
    assert visible.get("/colour", True) is True
    frusta = [message for message in found if message["type"] == "CameraFrustumMessage"]
    assert [message["name"] for message in frusta] == ["/input views/1 a-left.jpg", "/input views/2 b.jpg"]
    assert all(message["props"]["_image_data"] is not None for message in frusta)
    first = next(message for message in found if message["type"] == "SetCameraPositionMessage")
    assert first["position"] == pytest.approx((4.0, 8.0, 6.0))


def test_a_page_is_named_after_its_scene_as_text():
    page = scene_page(replace(wall_and_chair((4, 5)), source="<b>wall</b>"))
    assert "<title>&lt;b&gt;wall&lt;/b&gt;</title>" in page
    assert "opens the tree of classes" in page


def test_a_page_of_a_scene_without_classes_has_no_group_of_classes():
    found = messages(scene_page(wall_and_chair((4, 5), classes=False)))
    assert [message["name"] for message in found if message["type"] == "GaussianSplatsMessage"] == ["/colour/scene"]


def test_a_thinned_page_has_the_most_opaque_gaussians():
    scene = wall_and_chair()
    # The most opaque 10 are the last 10 columns of the last row, and all of the chair.
    names = [
        message["name"]
        for message in messages(scene_page(scene, at_most=10))
        if message["type"] == "GaussianSplatsMessage"
    ]
    assert names == ["/colour/chair", "/classes/chair"]


@pytest.mark.long
def test_a_page_of_the_default_number_of_gaussians_has_at_most_10_mb():
    """Random numbers: nothing compresses worse."""
    scene = wall_and_chair((250, 300))
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
    assert len(scene.gaussians) > MOST_GAUSSIANS
    photo = np.random.default_rng(1).integers(0, 256, (240, 320, 3), np.uint8)
    assert len(scene_page(scene, [photo, photo]).encode()) <= 10_000_000
