"""The cache of what the class branch finds in single views: each view is looked at once, and the result is that without a cache."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import pytest
import torch
from mapping_walls import INTRINSICS, SIZE, image, pose
from torch import Tensor

import semgs
from semgs.data.choosing.choice import choose
from semgs.data.demo_scene import demo_scene
from semgs.data.scenes import open_scene
from semgs.mapping.windows import encode_in_windows
from semgs.model.classes.mobilenet import MobileNetRefinement
from semgs.model.classes.mosaic import Mosaic
from semgs.model.classes.refinement import ViewFeatures
from semgs.model.classes.view_cache import ViewCache, digest
from semgs.model.encode import encode
from semgs.run.steps.pipeline import reconstruct


def brightness(images: Tensor, computed: list[Sequence[int]], cache: ViewCache) -> list[float]:
    """Of each image, as the cache has it."""

    def compute(new: Sequence[int]) -> ViewFeatures:
        computed.append(new)
        mean = images[list(new)].mean((1, 2, 3), keepdim=True)
        return ViewFeatures(mean, 2 * mean, (3 * mean, 4 * mean), again=5 * mean)

    found = cache.features(images, compute)
    assert found.second is None
    assert found.again is not None
    for times, maps in ((2, found.evidence), (3, found.cue_maps[0]), (4, found.cue_maps[1]), (5, found.again)):
        assert torch.equal(maps, times * found.features)
    return found.features.flatten().tolist()


def test_only_new_images_are_computed_and_the_oldest_are_forgotten():
    images = torch.tensor([0.0, 0.25, 0.5, 0.75]).reshape(4, 1, 1, 1).expand(4, 3, 2, 4).contiguous()
    cache, computed = ViewCache(most=2), []
    assert brightness(images[[0, 1]], computed, cache) == [0, 0.25]
    assert brightness(images[[0]], computed, cache) == [0]
    assert brightness(images[[2]], computed, cache) == [0.5]  # 0.25 is forgotten
    assert brightness(images[[1, 0]], computed, cache) == [0.25, 0]
    assert brightness(images[[0, 1, 2]], computed, cache) == [0, 0.25, 0.5]  # three at once are more than it keeps
    assert computed == [[0, 1], [0], [0], [2]]


def test_images_with_the_same_numbers_in_another_shape_differ():
    assert digest(torch.zeros(3, 2, 8)) != digest(torch.zeros(3, 4, 4))
    assert digest(torch.zeros(3, 4, 4)) == digest(torch.zeros(4, 3, 4).transpose(0, 1))


@pytest.fixture
def looked(monkeypatch: pytest.MonkeyPatch) -> list[int]:
    """The images that each part of the class branch has read: of one shape per look, in order."""
    read: list[int] = []
    for part in (MobileNetRefinement, Mosaic):
        plain = part.forward

        def counted(self, images, *others, plain=plain):
            read.append(len(images))
            return plain(self, images, *others)

        monkeypatch.setattr(part, "forward", counted)
    return read


def test_each_view_is_looked_at_once_in_windows_with_the_same_result(looked: list[int]):
    model, views = semgs.load("small"), open_scene(demo_scene()).read(range(4), (48, 64))
    model.looks = 2
    windows, cache = [[0, 1], [1, 2], [1, 2], [0, 3]], ViewCache()
    plain = encode_in_windows(views, windows, lambda some: encode(model, some).encoding, lambda _: None)
    assert sum(looked) == 3 * 2 * 2 * 2  # three windows of two views, two networks, two looks
    looked.clear()
    cached = encode_in_windows(views, windows, lambda some: encode(model, some, cache=cache).encoding, lambda _: None)
    assert sum(looked) == 4 * 2 * 2
    torch.testing.assert_close(cached.class_maps(), plain.class_maps(), atol=1e-5, rtol=0)
    torch.testing.assert_close(cached.depths, plain.depths, atol=1e-5, rtol=1e-5)


def test_reconstruct_looks_at_each_photo_once(looked: list[int]):
    scene = open_scene(demo_scene())
    choice = replace(choose(scene, 5), size=(48, 64))
    reconstruct(scene, choice, semgs.load("small"))
    assert sum(looked) == 5 * 2


def test_a_stream_looks_at_each_keyframe_once(looked: list[int]):
    frames = [((1 - 0.01 * number) * image(), pose(0.3 * number), INTRINSICS) for number in range(8)]
    *_, last = semgs.stream(frames, size=SIZE)
    assert len(last.views) >= 3
    assert sum(looked) == len(last.views) * 2
