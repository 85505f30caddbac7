"""What a run writes of the terms of its data."""

from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path

import pytest
from scenes_on_disk import SIZE, write_labelled
from training_data import run_data

from semgs.data.origin.terms import REPLICA, ROOMS, SCANNET, Terms, terms_text
from semgs.data.preparation.archive import Preparation, prepare_scene
from semgs.data.scenes import open_scene
from semgs.files.errors import InputError
from semgs.model.weights.header import DATA_TERMS
from semgs.model.weights.load import load
from semgs.model.weights.weights_file import save
from semgs.training.data.data_check.scene_record import RECORD, UNSTATED, data_terms_of
from semgs.training.training_settings import TrainingSettings

SETTINGS = TrainingSettings(model="small_plain", steps=3, batch=2, size=(16, 32), contexts=(2, 3), targets=1, seed=3, validation_scenes=0)  # fmt: skip


@pytest.fixture
def archive(tmp_path: Path) -> Path:
    """A scene that was prepared from ScanNet, to all appearance."""
    write_labelled(tmp_path / "scan", 1)
    (tmp_path / "prepared").mkdir()
    scene = replace(open_scene(tmp_path / "scan"), layout="ScanNet")
    prepare_scene(scene, tmp_path / "prepared" / "scan.zip", Preparation(SIZE))
    return tmp_path / "prepared"


def test_a_run_has_the_terms_of_all_its_data_and_of_the_weights_that_it_began_with(archive: Path, tmp_path: Path):
    first = tmp_path / "first.safetensors"
    save(first, load("small_plain", "random"), {DATA_TERMS: terms_text([REPLICA, SCANNET])})
    run_data(replace(SETTINGS, data=("rooms", str(archive)), init=str(first)), tmp_path)
    first.unlink()
    assert data_terms_of(tmp_path / RECORD) == (ROOMS, SCANNET, REPLICA)


def test_a_run_on_rooms_alone_has_theirs_alone(tmp_path: Path):
    run_data(SETTINGS, tmp_path)
    assert data_terms_of(tmp_path / RECORD) == (ROOMS,)


def test_what_is_not_known_is_said(tmp_path: Path):
    save(tmp_path / "old.safetensors", load("small_plain", "random"), {})
    run_data(replace(SETTINGS, init=str(tmp_path / "old.safetensors")), tmp_path)
    assert data_terms_of(tmp_path / RECORD) == (
        ROOMS,
        Terms("what old.safetensors was trained on: terms not stated"),
    )
    record = json.loads((tmp_path / RECORD).read_text())
    del record["terms"]
    (tmp_path / RECORD).write_text(json.dumps(record))
    assert data_terms_of(tmp_path / RECORD) == (UNSTATED,)


@pytest.mark.parametrize("terms", [5, None, ["ROOMS"], {"text": "a"}])
def test_terms_that_are_not_text_are_damage(tmp_path: Path, terms: object):
    """Found by fuzzing."""
    (tmp_path / RECORD).write_text(json.dumps({"terms": terms}))
    with pytest.raises(InputError, match=f"{RECORD}: expected the record of the run's data, found"):
        data_terms_of(tmp_path / RECORD)
