"""Trainings on prepared archives and on lists of scenes: what is seen, what is remembered of it, and rooms kept apart."""

from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path

import pytest
import torch
from scenes_on_disk import SIZE, write_labelled
from training_data import run_data, run_portions, run_validation

from semgs.data.preparation.archive import Preparation
from semgs.data.preparation.prepared_set import PreparedSet, Reading, find_sources
from semgs.data.views import Batch, Views
from semgs.files.errors import InputError
from semgs.model.weights.load import load, trained_scenes
from semgs.model.weights.weights_file import read_header, save
from semgs.training.data.data_check.scene_record import RECORD, scenes_of
from semgs.training.data.data_settings import Augmentation
from semgs.training.training_settings import TrainingSettings

SETTINGS = TrainingSettings(
    model="small_plain", steps=3, batch=2, size=(16, 32), contexts=(2, 3), targets=1, seed=3, validation_scenes=0
)
NAMES = ("scene0001_00", "scene0001_01", "scene0002_00", "scan")


@pytest.fixture(scope="module")
def scans(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A folder of four scenes, two of one room."""
    folder = tmp_path_factory.mktemp("listed") / "scans"
    for number, name in enumerate(NAMES):
        write_labelled(folder / name, number)
    return folder


@pytest.fixture(scope="module")
def archives(scans: Path, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The same, prepared: a folder with an archive each, and an index beside them."""
    out = tmp_path_factory.mktemp("prepared") / "set"
    PreparedSet(out, Preparation(SIZE), Reading()).prepare(find_sources(scans))
    return out


def batches(settings: TrainingSettings, run: Path) -> list[Batch]:
    run.mkdir(exist_ok=True)
    portions = run_portions(settings, run)
    return [batch for portion in portions for batch in portion.pieces]


def listed(folder: Path, *names: str) -> str:
    path = folder / "list.txt"
    path.write_text("\n".join(names))
    return str(path)


def test_archives_give_the_samples_of_the_folders_that_they_were_made_of(scans: Path, archives: Path, tmp_path: Path):
    plain = batches(replace(SETTINGS, data=(str(scans),)), tmp_path / "a")
    packed = batches(replace(SETTINGS, data=(str(archives),)), tmp_path / "b")
    assert [one.scenes for one in packed] == [one.scenes for one in plain]
    for a, b in zip(packed, plain, strict=True):
        assert torch.equal(a.context.labels, b.context.labels)
        assert torch.equal(a.target.labels, b.target.labels)
        assert (a.context.depths - b.context.depths).abs().max() < 0.001
        torch.testing.assert_close(a.context.cameras.world_from_camera, b.context.cameras.world_from_camera)
        assert (a.target.images - b.target.images).abs().mean() < 0.05  # JPEG of noise


def test_archives_serve_for_validation_too(archives: Path, tmp_path: Path):
    scenes = listed(tmp_path, "scan")
    settings = replace(SETTINGS, data=(str(archives),), scenes=scenes, validation=str(archives), validation_scenes=2)
    found = run_validation(settings, tmp_path)
    assert {one.scenes[0] for one in found} <= set(NAMES)


def test_a_list_says_which_scenes_of_all_folders_are_trained_on(scans: Path, archives: Path, tmp_path: Path):
    settings = replace(SETTINGS, data=(str(archives),), scenes=listed(tmp_path, "scene0002_00", "scan"), steps=8)
    seen = {scene for one in batches(settings, tmp_path / "run") for scene in one.scenes}
    assert seen == {"scene0002_00", "scan"}
    assert scenes_of(tmp_path / "run" / RECORD) == ("scan", "scene0002_00")
    with pytest.raises(InputError, match=r"list\.txt: 1 of 1 names: .* found scene0003_00, which is missing"):
        run_data(replace(settings, scenes=listed(tmp_path, "scene0003_00")), tmp_path)
    write_labelled(tmp_path / "other" / "room", 9)
    both = replace(settings, data=(str(archives), str(tmp_path / "other")), scenes=listed(tmp_path, "scan"))
    with pytest.raises(InputError, match=r"other: expected scenes of .*list\.txt, found none"):
        run_data(both, tmp_path)


def test_validation_in_rooms_that_are_trained_in_is_refused_and_names_them(scans: Path, tmp_path: Path):
    write_labelled(tmp_path / "held" / "scene0001_02", 7)
    settings = replace(SETTINGS, data=(str(scans),), validation=str(tmp_path / "held"), validation_scenes=1)
    with pytest.raises(InputError, match=r"held: .* found 1 that were: scene0001_02 \(as scene0001_0[01]\)"):
        run_data(settings, tmp_path)
    kept = replace(settings, scenes=listed(tmp_path, "scene0002_00", "scan"))
    assert run_validation(kept, tmp_path)


def test_a_run_remembers_its_scenes_and_those_that_its_first_weights_had_seen(archives: Path, tmp_path: Path):
    first = tmp_path / "first.safetensors"
    save(first, load("small_plain", "random"), {"scenes": json.dumps(["scene0009_00", "scan"])})
    scenes = listed(tmp_path, "scene0002_00", "scan")
    settings = replace(SETTINGS, data=(str(archives),), scenes=scenes, init=str(first))
    run_data(settings, tmp_path)
    first.unlink()  # a run goes on without the weights that it began with
    run_data(settings, tmp_path)
    assert scenes_of(tmp_path / RECORD) == ("scene0009_00", "scan", "scene0002_00")
    save(first, load("small_plain", "random"), {"scenes": json.dumps(["scene0009_00"])})
    write_labelled(tmp_path / "held" / "scene0009_01", 7)
    held = replace(settings, validation=str(tmp_path / "held"), validation_scenes=1)
    with pytest.raises(InputError, match=r"scene0009_01 \(as scene0009_00\)"):
        run_data(held, tmp_path / "anew")


def test_rooms_that_semgs_drew_leave_no_names(tmp_path: Path):
    listed = [{"name": "attic"}, {"name": "scene_00000", "drawn": True}, {"name": "hall", "drawn": False}]
    scenes = [{"frames": 1, "pixels": None, **scene} for scene in listed]
    record = {"scenes": scenes, "rooms": {"pixels": None}, "before": ["cellar"]}
    (tmp_path / "data.json").write_text(json.dumps(record))
    assert scenes_of(tmp_path / "data.json") == ("cellar", "attic", "hall")


def test_weights_name_the_scenes_that_they_saw(tmp_path: Path):
    assert trained_scenes("small") == ("learned",)  # the folder of labelled photos
    save(tmp_path / "odd.safetensors", load("small_plain", "random"), {"scenes": '{"a": 1}'})
    assert "scenes" in read_header(tmp_path / "odd.safetensors").metadata
    with pytest.raises(InputError, match=r"odd\.safetensors: scenes: expected a list of names"):
        trained_scenes(tmp_path / "odd.safetensors")


def test_the_frames_of_a_sample_are_checked_once_and_together(
    scans: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
):
    """Six samples of 3 or 4 views, cut, mirrored and recoloured: six checks."""
    varied = Augmentation(colour=0.2, crop=0.7, flip=True)
    settings = replace(SETTINGS, data=(str(scans),), augmentation=varied)
    portions = run_portions(settings, tmp_path)
    checks, constructor = [0], Views.__init__

    def counting(self: Views, *arguments: object, **named: object) -> None:
        checks[0] += 1
        constructor(self, *arguments, **named)

    monkeypatch.setattr(Views, "__init__", counting)
    made = [batch for portion in portions for batch in portion.pieces]
    assert sum(len(batch.scenes) for batch in made) == 6
    assert checks == [6]
