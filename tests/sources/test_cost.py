"""What networks take to run."""

from __future__ import annotations

import subprocess
import sys
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np
import pytest
from PIL import Image
from scenes_on_disk import SIZE, write_labelled

from semgs.data.scenes import open_scene
from semgs.data.tables.classes import ClassTable
from semgs.segmenters.class_map_files import MapFiles
from semgs.segmenters.opening import ViewSegmenter
from semgs.segmenters.tables import make_class_table
from semgs.sources import source as module
from semgs.sources.source import Cost, MadeBy, cost_of


@dataclass
class Slow:
    """A network that takes 50 ms of a clock of its own."""

    classes: ClassTable = field(default_factory=lambda: make_class_table("two", ("wall", "chair")))
    made_by: MadeBy = field(default_factory=lambda: MadeBy("slow", "0"))
    images: list[np.ndarray] = field(default_factory=list)
    now: float = 0.0

    def __call__(self, image: np.ndarray) -> np.ndarray:
        self.images.append(image)
        self.now += 0.05
        return np.full((2, 3, 4), 0.5, np.float32)


@pytest.mark.long
def test_time_and_memory_are_measured():
    # In an interpreter of its own, whose heap has no free memory of other tests.
    program = "import time, numpy; from semgs.sources.source import measured\n" + (
        "cost = measured(lambda: (time.sleep(0.05), numpy.ones(8_000_000)))\nprint(cost.seconds, cost.megabytes)"
    )
    ran = subprocess.run([sys.executable, "-c", program], capture_output=True, text=True, check=True)
    seconds, megabytes = ran.stdout.split()
    assert 0.05 <= float(seconds) < 5
    assert megabytes == "None" or 60 <= float(megabytes) < 100


def test_time_adds_up_and_memory_does_not():
    assert str(Cost(0.52, 81.4).times(3)) == "about 1.6 s and at most 81 MB more memory"
    assert str(Cost(0.52).times(2)) == "about 1.0 s"


def test_the_cost_of_frames_is_that_of_a_grey_image_for_each_frame_without_a_map(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
):
    scene = open_scene(write_labelled(tmp_path / "scene", 3))
    network = Slow()
    monkeypatch.setattr(module, "perf_counter", lambda: network.now)
    source = ViewSegmenter(network).source(scene, tmp_path / "maps")
    source.of(scene.frames[0], SIZE)
    cost = cost_of(source, scene.frames)
    (_, grey) = network.images
    assert cost is not None
    assert grey.shape == (*SIZE, 3)
    assert grey.min() == grey.max() == 128
    assert cost.seconds == pytest.approx(0.3), "six frames"

    later = ViewSegmenter(network).source(scene, earlier=tmp_path / "maps")
    cost = cost_of(later, scene.frames[:3])
    assert cost is not None
    assert cost.seconds == pytest.approx(0.1), "two frames"
    assert cost_of(later, scene.frames[:1]) is None
    assert cost_of(MapFiles.opened(tmp_path / "maps", scene), scene.frames) is None
    assert len(network.images) == 3


def test_a_network_may_answer_with_an_array_that_runs_backwards(tmp_path: Path):
    @dataclass
    class Backwards(Slow):
        def __call__(self, image: np.ndarray) -> np.ndarray:
            return np.broadcast_to(np.float32([[[0.25]], [[0.75]]]), (2, 3, 4))[::-1]

    scene = open_scene(write_labelled(tmp_path / "scene", 3))
    found = ViewSegmenter(Backwards())
    for maps in (found.source(scene).of(scene.frames[0], SIZE), found(scene.read([0, 1], SIZE))[0]):
        assert maps[:, 0, 0].tolist() == [0.75, 0.25]


@pytest.mark.parametrize(
    "other",
    [Slow(made_by=MadeBy("slow", "1")), Slow(classes=make_class_table("two", ("wall", "sofa")))],
    ids=["hash", "names"],
)
def test_maps_of_another_network_or_of_other_classes_are_made_anew(tmp_path: Path, other: Slow):
    scene = open_scene(write_labelled(tmp_path / "scene", 3))
    ViewSegmenter(Slow()).source(scene, tmp_path / "maps").of(scene.frames[0], SIZE)
    ViewSegmenter(other).source(scene, earlier=tmp_path / "maps").of(scene.frames[0], SIZE)
    assert len(other.images) == 1


def test_maps_of_other_photos_with_the_same_names_are_made_anew(tmp_path: Path):
    """The output folder may have been another scene's before."""
    scene = open_scene(write_labelled(tmp_path / "scene", 3))
    ViewSegmenter(Slow()).source(scene, tmp_path / "maps").of(scene.frames[0], SIZE)
    photo = tmp_path / "scene" / scene.frames[0].name
    Image.fromarray(255 - np.asarray(Image.open(photo))).save(photo)
    network = Slow()
    later = ViewSegmenter(network).source(scene, earlier=tmp_path / "maps")
    assert cost_of(later, scene.frames[:1]) is not None
    later.of(scene.frames[0], SIZE)
    assert len(network.images) == 2, "a grey image, and the photo"
