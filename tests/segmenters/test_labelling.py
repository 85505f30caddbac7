"""Gaussians that take their classes from a source."""

from __future__ import annotations

import math
from dataclasses import dataclass, field, replace
from pathlib import Path

import numpy as np
import pytest
import torch
from scenes_on_disk import SIZE, write_labelled

from semgs.data.frames import Frame
from semgs.data.resampling import Fit
from semgs.data.scene import Scene
from semgs.data.scenes import open_scene
from semgs.data.tables.classes import SCANNET20, ClassTable
from semgs.geometry.fusion import LEAST
from semgs.model.encode import encode
from semgs.model.weights.load import load
from semgs.scene.encoding import Encoding
from semgs.segmenters.class_source import Translated
from semgs.segmenters.labelling import Labelling, combine
from semgs.segmenters.names import Correspondence
from semgs.segmenters.opening import ViewSegmenter
from semgs.segmenters.tables import make_class_table
from semgs.sources.source import MadeBy

LIGHT_DARK = make_class_table("light-dark", ("light", "dark"))


@dataclass
class Brightness:
    """A segmenter that says how light each pixel is, at a third of the resolution."""

    classes: ClassTable = LIGHT_DARK
    made_by: MadeBy = field(default_factory=lambda: MadeBy("brightness", "0", "MIT"))
    calls: int = 0

    def __call__(self, image: np.ndarray) -> np.ndarray:
        self.calls += 1
        light = image[::3, ::3].astype(np.float32).mean(-1) / 255
        return np.stack((light, 1 - light))


@dataclass(frozen=True)
class Certain:
    """A source that says one class of every pixel of a frame."""

    said: dict[str, int]
    classes: ClassTable = SCANNET20
    title: str = "certain"
    made_by: None = None

    @property
    def known(self) -> np.ndarray:
        return np.ones(len(self.classes), bool)

    def of(self, frame: Frame, size: tuple[int, int], fit: Fit = "crop") -> torch.Tensor:
        found = torch.zeros(len(self.classes), *size)
        found[self.said[frame.name]] = 1
        return found


@pytest.fixture(scope="module")
def scene(tmp_path_factory: pytest.TempPathFactory) -> Scene:
    return open_scene(write_labelled(tmp_path_factory.mktemp("labelling") / "scene", 5))


@pytest.fixture(scope="module")
def encoding(scene: Scene) -> Encoding:
    model = load("small", "random")
    return replace(encode(model, scene.read((0, 3))).encoding, classes=model.classes)


def test_gaussians_take_the_class_of_their_pixel(scene: Scene, encoding: Encoding):
    names = [scene.frames[place].name for place in (0, 3)]
    source = Certain({names[0]: 4, names[1]: 7})
    found = Labelling(source, fusion=False)(encoding, scene, (0, 3), scene.read((0, 3)))
    assert found.classes is SCANNET20
    labels = found.class_maps().argmax(1)
    assert [one.unique().tolist() for one in labels] == [[4], [7]]
    torch.testing.assert_close(found.gaussians.means, encoding.gaussians.means, rtol=0, atol=0)


def test_class_maps_are_what_with_classes_took(encoding: Encoding):
    generator = torch.Generator().manual_seed(2)
    maps = torch.rand(2, 3, *encoding.depths.shape[-2:], generator=generator).softmax(1)
    stride = round((maps[:, 0].numel() / len(encoding.gaussians)) ** 0.5)
    table = make_class_table("three", ("a", "b", "c"))
    found = encoding.with_classes(maps, table).class_maps()
    blocks = torch.nn.functional.avg_pool2d(maps, stride, ceil_mode=True)
    torch.testing.assert_close(found[..., ::stride, ::stride], blocks)


def test_a_class_that_the_segmenter_cannot_say_gets_a_neutral_vote():
    """It says 0.8 and 0.2 of classes 0 and 1 and does not know class 2. The network says 0.3, 0.3, 0.4: class 2 gets the mean of log 0.8 and log 0.2."""
    theirs = torch.tensor([0.8, 0.2, 0.0]).double()[:, None, None]
    own = torch.tensor([0.3, 0.3, 0.4]).double()[:, None, None]
    known = torch.tensor([True, True, False])
    neutral = math.sqrt((0.8 + LEAST) * (0.2 + LEAST))
    products = [(0.3 + LEAST) * (0.8 + LEAST), (0.3 + LEAST) * (0.2 + LEAST), (0.4 + LEAST) * neutral]
    found = combine(theirs, own, known).flatten()
    torch.testing.assert_close(found, torch.tensor(products).double() / sum(products))


def test_the_own_classes_vote_only_in_one_table(scene: Scene, encoding: Encoding):
    source = ViewSegmenter(Brightness()).source(scene)
    with pytest.raises(ValueError, match="the network has scannet20, the segmenter light-dark"):
        Labelling(source, own=True)(encoding, scene, (0, 3), scene.read((0, 3)))


def test_a_network_sees_the_photo_at_its_own_size_and_its_maps_are_used_again(scene: Scene, tmp_path: Path):
    network = Brightness()
    first = ViewSegmenter(network).source(scene, tmp_path / "a").of(scene.frames[1], (12, 16))
    image = scene.frames[1].read_undistorted()
    expected = torch.from_numpy(image[::3, ::3].astype(np.float32).mean(-1) / 255)
    rows, columns = expected.shape
    assert (rows, columns) == (8, 11)
    light = torch.nn.functional.interpolate(expected[None, None], SIZE, mode="bilinear", align_corners=False)
    torch.testing.assert_close(first[0], torch.nn.functional.avg_pool2d(light, 2)[0, 0], rtol=0, atol=1e-5)
    again = ViewSegmenter(network).source(scene, tmp_path / "b", tmp_path / "a").of(scene.frames[1], (12, 16))
    assert network.calls == 1
    torch.testing.assert_close(again, first, rtol=0, atol=1e-3)
    assert (tmp_path / "b/images/001.npz").is_file()
    other = Brightness(made_by=MadeBy("brightness", "1", "MIT"))
    ViewSegmenter(other).source(scene, None, tmp_path / "a").of(scene.frames[1], (12, 16))
    assert other.calls == 1


def test_views_in_memory_are_segmented_from_their_images(scene: Scene):
    views = scene.read((0, 3), "native")
    found = ViewSegmenter(Brightness())(views)
    assert found.shape == (2, 2, *SIZE)
    torch.testing.assert_close(found.sum(1), torch.ones(2, *SIZE))
    torch.testing.assert_close(
        found[1], ViewSegmenter(Brightness()).source(scene).of(scene.frames[3], SIZE), rtol=0, atol=0.005
    )


def test_a_translated_source_knows_what_its_names_mean(scene: Scene):
    table = np.zeros((2, 20), np.float32)
    table[0, 4] = table[1, 7] = 1
    names = [frame.name for frame in scene.frames]
    source = Translated(Certain(dict.fromkeys(names, 1), LIGHT_DARK), Correspondence(table, SCANNET20))
    assert source.known.nonzero()[0].tolist() == [4, 7]
    assert source.of(scene.frames[0], (3, 4))[7].min() == 1
    assert Labelling(source, own=True).description == "certain, and the model; fused over the input views"
