"""Scores of single images, worked out by hand."""

from __future__ import annotations

import json
from dataclasses import dataclass, field, replace
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest
import torch
from image_sets import write_image_set
from networks import preset

from semgs.data.frames import Frame
from semgs.data.scene import Scene
from semgs.data.scenes import open_scene
from semgs.data.tables.classes import SCANNET20, ClassTable
from semgs.data.views import Views
from semgs.evaluation.scoring.summary import summarise
from semgs.evaluation.single_images import (
    Trial,
    evaluate_single_images,
    score_single_images,
    single_grids,
    single_numbers,
    tried,
)
from semgs.evaluation.tables.evaluation_report import EvaluatedMethod
from semgs.files.errors import InputError
from semgs.files.images.pictures import read_uint8
from semgs.model.semgs import SemGS
from semgs.rendering.temperatures import Temperatures
from semgs.segmenters.class_map_files import Photos
from semgs.sources.source import MadeBy

SUBJECT = EvaluatedMethod("by colour", "weights", "known by heart", "0" * 64, 1)


def by_colour(temperatures: Temperatures | None = None) -> SemGS:
    """A network to which red in the left half of an image is wall, and everything else floor, with confidence 0.8."""

    def classify(views: Views, alone: bool) -> torch.Tensor:
        assert alone
        assert len(views) == 1
        walls = views.images[:, 0] > 0.5
        walls[..., views.size[1] // 2 :] = False
        found = torch.full((1, len(SCANNET20), *views.size), 0.2 / 19)
        found[:, 0][walls] = found[:, 1][~walls] = 0.8
        return found

    network = preset("small")
    network.temperatures = temperatures
    network.classify = classify  # type: ignore[method-assign]
    return network


@pytest.fixture
def images(tmp_path: Path) -> Scene:
    """An image of walls, and one of floor above nothing known."""
    walls, floor = np.zeros((16, 32)), np.ones((32, 16))
    floor[16:] = 200
    return open_scene(write_image_set(tmp_path / "two", {"walls": walls, "floor": floor}), needs_cameras=False)


def test_the_note_of_two_images_does_not_say_that_their_intervals_are_over_scenes(images: Scene):
    table, _ = single_grids({"by colour": score_single_images(by_colour(), [images])}, SCANNET20)
    assert "intervals over frames, as there are fewer than 5 scenes; images" in table.notes[0]


def test_scores_are_those_worked_out_by_hand(images: Scene):
    numbers = single_numbers(SUBJECT, [images], score_single_images(by_colour(), [images]), SCANNET20)
    # Of 512 pixels of wall, 256 are called wall and 256 floor; 256 pixels of floor are called floor; 256 pixels do not count.
    assert numbers["images"] == 2
    assert numbers["accuracy"] == pytest.approx(512 / 768)
    assert numbers["miou"] == pytest.approx((256 / 512 + 256 / 512) / 2)
    assert numbers["miou_per_image"] == pytest.approx((256 / 512 + 1) / 2)
    assert numbers["class_accuracy"] == pytest.approx((1 / 2 + 1) / 2)
    assert numbers["ece"] == pytest.approx(0.8 - 512 / 768, abs=0.01)  # confidences are counted in levels
    assert [(one["name"], one["pixels"]) for one in numbers["per_class"] if one["pixels"]] == [
        ("wall", 512),
        ("floor", 256),
    ]


def test_images_with_one_file_name_have_a_file_of_classes_each(images: Scene, tmp_path: Path):
    floor, walls = images.frames
    alike = replace(images, frames=(replace(floor, name="left/1.png"), replace(walls, name="right/1.png")))
    evaluate_single_images(tmp_path / "out", by_colour(), SUBJECT, [alike])
    files = sorted((tmp_path / "out" / "predictions" / alike.name).iterdir())
    assert [file.name for file in files] == ["000_1.png", "001_1.png"]
    assert [set(np.unique(read_uint8(file)).tolist()) for file in files] == [{1}, {0, 1}]
    report = json.loads((tmp_path / "out" / "report.json").read_text())
    assert [one["target"] for one in report["per_image"]] == ["000_1", "001_1"]


def test_the_temperature_of_single_gaussians_changes_confidence_alone(images: Scene):
    cold = by_colour(Temperatures(rendered=9.0, gaussians=0.5))
    numbers = single_numbers(SUBJECT, [images], score_single_images(cold, [images]), SCANNET20)
    confidence = 0.8**2 / (0.8**2 + 19 * (0.2 / 19) ** 2)
    assert numbers["ece"] == pytest.approx(confidence - 512 / 768, abs=0.01)
    assert numbers["miou"] == pytest.approx(0.5)


def test_the_folder_contains_the_report_and_the_classes_of_every_pixel(images: Scene, tmp_path: Path):
    counted: list[int] = []
    told = evaluate_single_images(tmp_path / "out", by_colour(), SUBJECT, [images], done=counted.append)
    assert counted == [1, 2]
    assert "by colour" in told
    assert "0.500" in told
    report = json.loads((tmp_path / "out/report.json").read_text())
    assert report["format"] == "semgs.report.single"
    assert [one["target"] for one in report["per_image"]] == ["floor", "walls"]
    walls = read_uint8(tmp_path / "out/predictions/two/walls.png")
    np.testing.assert_array_equal(walls, np.repeat([[0, 1]], 16, 0).repeat(16, 1))


def test_a_size_applies_to_all_images(images: Scene):
    frames = score_single_images(by_colour(), [images], (16, 16))
    assert [int(frame.truth.sum()) for frame in frames if frame.truth is not None] == [128, 256]


def test_each_image_without_a_camera_counts_as_a_scene(images: Scene):
    frames = score_single_images(by_colour(), [images])
    assert [(frame.scene, frame.target) for frame in frames] == [("two/floor", "floor"), ("two/walls", "walls")]


def test_trials_are_rows_and_a_flipped_one_is_the_mean_with_the_mirror_image(images: Scene, tmp_path: Path):
    """Wall to the left and floor to the right, whatever the image shows, at .7 to .3: right for half of the walls, and for half of the floor. With the mirror image
    both are even, so the first, the wall: right for all walls and no floor."""
    network = by_colour()

    def classify(views: Views, alone: bool = False) -> torch.Tensor:
        """The distributions of each view."""
        found = torch.zeros(len(views), 20, *views.size)
        half = views.size[1] // 2
        found[:, 0], found[:, 1] = 0.3, 0.7
        found[:, 0, :, :half], found[:, 1, :, :half] = 0.7, 0.3
        return found

    network.classify = classify  # type: ignore[method-assign]
    counted: list[int] = []
    printed = evaluate_single_images(
        tmp_path / "out", network, SUBJECT, [images], done=counted.append, trials=[Trial(16), Trial(16, flip=True)]
    )
    assert counted == [1, 2, 3, 4]
    assert "by colour at 16 px, flipped" in printed
    report = json.loads((tmp_path / "out/report.json").read_text())
    assert [(name, one["accuracy"]) for name, one in report["rows"].items()] == [
        ("by colour at 16 px", pytest.approx(384 / 768)),
        ("by colour at 16 px, flipped", pytest.approx(512 / 768)),
    ]
    assert report["accuracy"] == report["rows"]["by colour at 16 px"]["accuracy"]
    assert Trial(32).size((480, 640)) == (32, 48), "640 / 480 of 32 is 42.7, the nearest multiple of 16 is 48"
    assert Trial().size((480, 640)) == (240, 320)


def test_a_segmenter_answers_instead_of_the_network(images: Scene):
    """It says floor everywhere: all 256 pixels of floor are right, and none of the 512 of wall."""

    def of(frame: Frame, size: tuple[int, int], fit: str) -> torch.Tensor:
        """Floor."""
        return torch.nn.functional.one_hot(torch.ones(size, dtype=torch.long), 20).permute(2, 0, 1).float()

    labelling = SimpleNamespace(source=SimpleNamespace(of=of))
    frames = score_single_images(by_colour(), [images], labelling=lambda scene: labelling)  # type: ignore[arg-type, return-value]
    assert summarise(frames)["accuracy"] == pytest.approx(256 / 768)


@dataclass(frozen=True)
class Halves:
    """A segmenter that says wall to the left and floor to the right at .7 to .3, and notes the sizes that it sees."""

    seen: list[tuple[int, ...]] = field(default_factory=list)
    classes: ClassTable = SCANNET20
    made_by: MadeBy = field(default_factory=lambda: MadeBy("halves", "0" * 64))

    def __call__(self, image: np.ndarray) -> np.ndarray:
        """The distributions of an image."""
        self.seen.append(image.shape[:2])
        found = np.zeros((20, *image.shape[:2]), np.float32)
        found[0], found[1] = 0.3, 0.7
        half = image.shape[1] // 2
        found[0, :, :half], found[1, :, :half] = 0.7, 0.3
        return found


def test_a_segmenter_sees_images_at_the_size_of_the_trial_and_mirrored(images: Scene, tmp_path: Path):
    """As the network of `test_trials_are_rows...`: half of all pixels by itself, all walls with the mirror image. Both images have a short side of 16 px; at 32
    they are 32x64 (walls) and 64x32. Maps of files are of no mirror image."""
    network = Halves()
    labelling = SimpleNamespace(source=Photos(network))
    for trial, accuracy in ((Trial(16), 384 / 768), (Trial(16, flip=True), 512 / 768)):
        frames = score_single_images(by_colour(), [images], trial=trial, labelling=lambda scene: labelling)  # type: ignore[arg-type, return-value]
        assert summarise(frames)["accuracy"] == pytest.approx(accuracy)
    network.seen.clear()
    score_single_images(by_colour(), [images], trial=Trial(32), labelling=lambda scene: labelling)  # type: ignore[arg-type, return-value]
    assert sorted(network.seen) == [(32, 64), (64, 32)]
    maps = SimpleNamespace(title="maps")
    with pytest.raises(InputError, match="maps: expected a network, which can classify mirror images, found maps of"):
        tried(maps, Trial(flip=True))  # type: ignore[arg-type]
    assert tried(maps, Trial(32)) is maps  # type: ignore[arg-type]
