"""Scenes with a segmenter's labels: which pixels get one, where they land, and whose terms they carry."""

from __future__ import annotations

import json
from collections.abc import Callable
from dataclasses import dataclass, field, replace
from pathlib import Path

import numpy as np
import pytest
import torch
from scenes_on_disk import SIZE, write_labelled
from training_data import run_data

from semgs.data.origin.licences import labeller_of, terms_of, terms_of_photos
from semgs.data.origin.terms import ROOMS, Labeller, Terms
from semgs.data.preparation.archive import Preparation, prepare_scene
from semgs.data.preparation.prepared_set import PreparedSet, Reading, find_sources
from semgs.data.scenes import open_scene
from semgs.data.tables.classes import SCANNET20, ClassTable
from semgs.segmenters.class_map_files import MapFiles, save_table
from semgs.segmenters.opening import ViewSegmenter
from semgs.segmenters.relabelling import Relabelling, _reduced, likeliest_labels, open_relabelling, relabel_scene
from semgs.segmenters.tables import make_class_table
from semgs.sources.source import MadeBy
from semgs.training.data.data_check.scene_record import RECORD, data_terms_of, scenes_of
from semgs.training.training_settings import TrainingSettings

THINGS = make_class_table("things", ["cup", "mug", "tin", "jar"])


@dataclass(frozen=True)
class Columns:
    """A segmenter that answers by position: as many equal columns as classes, each sure to a degree."""

    classes: ClassTable = THINGS
    made_by: MadeBy = MadeBy("columns.onnx", "c0", "cc-by-nc-4.0")  # noqa: RUF009
    sure: float = 0.9
    calls: list[tuple[int, ...]] = field(default_factory=list)

    def __call__(self, image: np.ndarray) -> np.ndarray:
        self.calls.append(image.shape)
        height, width = image.shape[:2]
        count = len(self.classes)
        columns = np.arange(width) * count // width
        others = np.full((count, height, width), (1 - self.sure) / (count - 1), np.float32)
        others[columns, :, np.arange(width)] = self.sure
        return others


@pytest.fixture
def scans(tmp_path: Path) -> Path:
    for seed, name in enumerate(("kitchen", "office")):
        write_labelled(tmp_path / "scans" / name, seed, frames=3)
    return tmp_path / "scans"


def fake(segmenter: Columns, confidence: float = 0.5) -> Relabelling:
    """Scenes with such labels."""
    opened = ViewSegmenter(segmenter)
    return Relabelling(Reading(), opened.source, {"segmenter": "columns"}, confidence)


def test_a_pixel_has_a_label_if_one_class_is_likely_enough_and_alone():
    said = torch.tensor([[0.5, 0.3, 0.2], [0.49, 0.3, 0.21], [0.1, 0.2, 0.7], [0.5, 0.5, 0.0], [0.0, 1.0, 0.0]])
    assert likeliest_labels(said.T[:, None], 0.5).tolist() == [[0, 255, 2, 255, 1]]
    assert likeliest_labels(torch.full((4, 1, 1), 0.25), 0.0).tolist() == [[255]]


@pytest.mark.parametrize("bent", [False, True])
def test_labels_land_on_the_pixels_that_the_segmenter_saw_through_lens_and_crop(scans: Path, bent: bool):
    """A view of 20x16 (height x width) keeps 19 of 32 columns, from the seventh on: the centre of its column c is at
    6 + (c + 0.5) 19 / 16 px of the undistorted photo, whose quarters are 8 px wide."""
    scene = open_scene(scans / "kitchen")
    if bent:
        lens = replace(scene.frames[0].lens, distortion=(-0.2, 0.03, 0.01, 0.0, 0.0))
        scene = replace(scene, frames=tuple(replace(frame, lens=lens) for frame in scene.frames))
    assert scene.frames[0].lens.is_pinhole != bent
    found = relabel_scene(scene, ViewSegmenter(Columns()).source(scene), 0.5).read([1, 2], (20, 16)).labels
    assert found is not None
    expected = [int((6 + (c + 0.5) * 19 / 16) / 8) for c in range(16)]
    assert sorted(set(expected)) == [0, 1, 2, 3]
    assert found.tolist() == [[expected] * 20] * 2


def test_a_photo_is_segmented_whole_but_its_distributions_stay_small():
    assert _reduced((480, 640)) == (480, 640)
    assert _reduced((3000, 4000)) == (480, 640)
    assert _reduced((4000, 3000)) == (640, 480)
    assert _reduced((24, 32)) == (24, 32)


def test_a_set_is_labelled_once_and_carries_the_teachers_name_and_licence(scans: Path, tmp_path: Path):
    segmenter, out = Columns(), tmp_path / "out"
    index = PreparedSet(out, Preparation(SIZE), fake(segmenter)).prepare(find_sources(scans))
    assert (index["frames"], index["failed"], segmenter.calls) == (6, [], [(*SIZE, 3)] * 6)
    assert index["pixels"] == {"cup": 1152, "mug": 1152, "tin": 1152, "jar": 1152, "ignored": 0}
    scene = open_scene(out / "office.zip")
    assert (scene.classes.names, scene.classes.colours) == (THINGS.names, THINGS.colours)
    views = scene.read([0, 1], "native")
    assert torch.equal(views.labels[0, 5], torch.arange(32).to(torch.uint8) // 8)
    assert views.depths is not None
    assert labeller_of(scene) == Labeller("columns.onnx", "cc-by-nc-4.0")
    photos = terms_of_photos(open_scene(scans / "office"))
    assert not photos.own
    assert terms_of(scene) == Terms(f"{photos.text}; labels by columns.onnx (licence cc-by-nc-4.0)", own=True)
    prepare_scene(scene, tmp_path / "twice.zip", Preparation(SIZE))
    assert terms_of(open_scene(tmp_path / "twice.zip")) == terms_of(scene)
    PreparedSet(out, Preparation(SIZE), fake(segmenter)).prepare(find_sources(scans))
    assert len(segmenter.calls) == 6, "nothing is segmented again"
    with pytest.raises(ValueError, match=r"other settings: confidence is 0\.5 there, not 0\.7"):
        PreparedSet(out, Preparation(SIZE), fake(segmenter, 0.7)).prepare(find_sources(scans))


def test_labels_of_a_model_of_the_hub_name_the_commit_that_made_them(scans: Path, tmp_path: Path):
    """Also if its maps were saved and are labels later."""
    commit = "0123456789abcdef0123456789abcdef01234567"
    segmenter = Columns(made_by=MadeBy("hf:owner/net@main", "c0", "MIT", commit))
    PreparedSet(tmp_path / "out", Preparation(SIZE), fake(segmenter)).prepare(find_sources(scans))
    named = Labeller(f"hf:owner/net@{commit}", "MIT")
    assert labeller_of(open_scene(tmp_path / "out" / "office.zip")) == named
    save_table(tmp_path / "maps", THINGS, segmenter.made_by)
    scene = open_scene(scans / "office")
    assert relabel_scene(scene, MapFiles.opened(tmp_path / "maps", scene), 0.5).labeller == named


def test_pixels_below_the_confidence_are_ignored(scans: Path, tmp_path: Path):
    index = PreparedSet(tmp_path / "out", Preparation(SIZE), fake(Columns(sure=0.6), 0.61)).prepare(find_sources(scans))
    assert index["pixels"] == {"cup": 0, "mug": 0, "tin": 0, "jar": 0, "ignored": 6 * 24 * 32}


def test_a_student_has_the_terms_of_its_teacher_and_rooms_stay_rooms(tmp_path: Path):
    write_labelled(tmp_path / "rooms" / "scene_00000", 3, frames=4)
    (tmp_path / "rooms" / "scene_00000" / "room.json").write_text('{"kind": "kitchen"}')
    teacher = Columns(SCANNET20, MadeBy("teacher.onnx", "7e", "Apache-2.0"))
    PreparedSet(tmp_path / "taught", Preparation(SIZE), fake(teacher, 0.2)).prepare(find_sources(tmp_path / "rooms"))
    settings = TrainingSettings(
        model="small_plain", steps=3, size=(16, 32), contexts=(2, 2), targets=1, validation_scenes=0, data=(str(tmp_path / "taught"),)
    )  # fmt: skip
    run_data(settings, tmp_path)
    (terms,) = data_terms_of(tmp_path / RECORD)
    assert terms == Terms(f"{ROOMS.text}; labels by teacher.onnx (licence Apache-2.0)")
    assert scenes_of(tmp_path / RECORD) == (), "rooms of other seeds have the same names"


def write_maps(folder: Path, number: Callable[[int], int] = lambda column: column // 8) -> None:
    """Class numbers of a scene's three frames."""
    from semgs.files.images.pictures import write_png

    (folder / "images").mkdir(parents=True)
    for frame in range(3):
        write_png(
            folder / "images" / f"{frame:03d}.png",
            np.tile(np.array([number(c) for c in range(32)], np.uint8), (24, 1)),
        )


def write_table(folder: Path, *names: str) -> None:
    """A table of classes by name."""
    (folder / "classes.json").write_text(json.dumps({"name": "few", "classes": [{"name": one, "colour": [9, 9, 9]} for one in names]}))  # fmt: skip


def test_class_maps_of_several_scenes_share_a_table_or_have_their_own(scans: Path, tmp_path: Path):
    maps = tmp_path / "maps"
    write_maps(maps / "kitchen")
    write_maps(maps / "office", lambda column: 1 - column // 16)
    write_table(maps, "wall", "floor", "sky", "chair")
    write_table(maps / "office", "floor", "wall")
    found = open_relabelling(str(maps), Reading(), "scannet20")
    index = PreparedSet(tmp_path / "out", Preparation(SIZE), found).prepare(find_sources(scans))
    assert index["failed"] == []
    kitchen, office = (open_scene(tmp_path / "out" / f"{name}.zip") for name in ("kitchen", "office"))
    labels = [one.read([0, 1], "native").labels[0, 3] for one in (kitchen, office)]
    assert labels[0].tolist() == [0] * 8 + [1] * 8 + [255] * 8 + [4] * 8, "sky says nothing of ScanNet's classes"
    assert labels[1].tolist() == [0] * 16 + [1] * 16
    assert terms_of(kitchen).text.endswith("; labels by class maps in files (licence unknown)")
    assert not terms_of(kitchen).own


def test_a_folder_of_one_network_is_not_resumed_with_another_of_the_same_name(
    scans: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
):
    """The file is exported again, so labels of two networks would be mixed."""
    opened = ViewSegmenter(Columns())
    monkeypatch.setattr("semgs.segmenters.relabelling.open_class_sources", lambda *given, **named: opened.source)
    network = tmp_path / "net.onnx"

    def prepared(content: bytes) -> PreparedSet:
        network.write_bytes(content)
        return PreparedSet(tmp_path / "out", Preparation(SIZE), open_relabelling(str(network), Reading()))

    prepared(b"first").prepare(find_sources(scans))
    prepared(b"first").check()
    with pytest.raises(ValueError, match="network"):
        prepared(b"second").check()
