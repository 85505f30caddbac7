"""Predictions in files: what is written is read again, what is incomplete or wrong is refused by name."""

from __future__ import annotations

import json
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
import torch

from semgs.data.scene import Scene
from semgs.evaluation.frames.frame_plan import FramePlan, make_plan
from semgs.evaluation.frames.predictions import Prediction, write_prediction
from semgs.evaluation.frames.protocols import neighbours
from semgs.evaluation.frames.saved import SavedPredictions, find_view_counts
from semgs.files.errors import InputError
from semgs.files.images.pictures import write_png

MakeScene = Callable[..., Scene]


@pytest.fixture
def plan(make_scene: MakeScene) -> FramePlan:
    return make_plan("neighbours", neighbours, [make_scene(frames=5)], (2, 3), (36, 48))


@pytest.fixture
def folder(plan: FramePlan, tmp_path: Path) -> Path:
    """Label maps of all targets."""
    for number, task in enumerate(plan.tasks):
        write_prediction(tmp_path / "theirs", task, Prediction(labels=torch.full((36, 48), number).byte()))
    return tmp_path / "theirs"


def test_what_is_written_is_read_again(plan: FramePlan, tmp_path: Path):
    task = plan.tasks[1]
    generator = torch.Generator().manual_seed(0)
    labels = torch.randint(0, 20, (36, 48), generator=generator).byte()
    labels[3, 5] = 255
    image = torch.randint(0, 256, (3, 36, 48), generator=generator) / 255
    depths = 0.5 + 3 * torch.rand(36, 48, generator=generator)
    unseen = torch.rand(36, 48, generator=generator) < 0.1
    write_prediction(tmp_path, task, Prediction(labels, image, depths, unseen, 0.5, 0.25))
    again = SavedPredictions(tmp_path, "mine").read(task)
    assert again.labels is not None
    assert again.image is not None
    assert again.depths is not None
    assert torch.equal(again.labels, labels)
    assert (again.image - image).abs().max() < 1e-6
    assert (again.depths - depths).abs().max() <= 0.0005001
    assert (again.unseen, again.seconds_encode) == (None, None)


def test_depths_of_an_unknown_unit_are_kept_as_they_are(make_scene: MakeScene, tmp_path: Path):
    scene = make_scene(depth=False, change=lambda file: file.update(metric=False))
    task = make_plan("neighbours", neighbours, [scene], (2,), (36, 48)).tasks[0]
    depths = 70 + torch.rand(36, 48, generator=torch.Generator().manual_seed(0))
    write_prediction(tmp_path, task, Prediction(depths=depths))
    again = SavedPredictions(tmp_path, "mine").read(task)
    assert again.depths is not None
    assert torch.equal(again.depths, depths)


def test_of_scenes_without_labels_at_least_images_must_be_there(make_scene: MakeScene, tmp_path: Path):
    plan = make_plan("neighbours", neighbours, [make_scene(frames=3, labels=False)], (2,), (36, 48))
    (tmp_path / "N2/living").mkdir(parents=True)
    with pytest.raises(
        InputError, match=r"a file of colour of all 1 targets of 2 views, found none of N2/living/001.colour.png"
    ):
        SavedPredictions(tmp_path, "theirs").check(plan)
    write_prediction(tmp_path, plan.tasks[0], Prediction(depths=torch.ones(36, 48)))
    SavedPredictions(tmp_path, "theirs").check(plan)


def test_seconds_come_from_a_file_a_number_of_views(plan: FramePlan, folder: Path):
    (folder / "N2" / "timing.json").write_text(json.dumps({"seconds_encode": 3, "seconds_render": 0.5, "gpu": "one"}))
    read = SavedPredictions(folder, "theirs").read(plan.tasks[0])
    assert (read.seconds_encode, read.seconds_render) == (3.0, 0.5)
    assert SavedPredictions(folder, "theirs").read(plan.of(3)[0]).seconds_encode is None
    for text in ("[]", "{", '{"seconds_render": "fast"}', '{"seconds_render": -1}'):
        (folder / "N2" / "timing.json").write_text(text)
        with pytest.raises(InputError, match=r"timing\.json"):
            SavedPredictions(folder, "theirs").read(plan.tasks[0])


def test_missing_predictions_are_told_by_their_frames(plan: FramePlan, folder: Path):
    SavedPredictions(folder, "theirs").check(plan)
    (folder / "N3/living/002.png").unlink()
    with pytest.raises(InputError, match=r"labels of all 3 targets of 3 views, found none of N3/living/002\.png$"):
        SavedPredictions(folder, "theirs").check(plan)


def test_a_number_of_views_without_any_prediction_is_told(plan: FramePlan, folder: Path):
    for path in (folder / "N3/living").iterdir():
        path.unlink()
    with pytest.raises(InputError, match=r"none of N3/living/001\.png, N3/living/002\.png, N3/living/003\.png$"):
        SavedPredictions(folder, "theirs").check(plan)


def test_a_kind_may_be_left_out_as_a_whole_and_not_in_part(plan: FramePlan, folder: Path):
    picture = np.zeros((36, 48, 3), np.uint8)
    write_png(folder / "N2/living/001.colour.png", picture)
    with pytest.raises(
        InputError, match=r"a file of colour of all 3 targets of 2 views, found none of N2/living/002\.colour\.png"
    ):
        SavedPredictions(folder, "theirs").check(plan)
    for name in ("002", "003"):
        write_png(folder / f"N2/living/{name}.colour.png", picture)
    SavedPredictions(folder, "theirs").check(plan)
    for path in folder.glob("N2/living/00?.png"):
        path.unlink()
    SavedPredictions(folder, "theirs").check(plan)


def test_pictures_of_another_size_are_told_by_their_frames(plan: FramePlan, folder: Path):
    write_png(folder / "N2/living/003.png", np.zeros((48, 36), np.uint8))
    with pytest.raises(
        InputError, match=r"of 36x48 pixels \(height x width\), found others: N2/living/003\.png \(48x36\)"
    ):
        SavedPredictions(folder, "theirs").check(plan)
    depth = folder / "N2/living/001.depth.npy"
    np.save(depth, np.ones((3, 4), np.float32))
    with pytest.raises(InputError, match=r"001\.depth\.npy: expected \(36, 48\) \(height, width\), found \(3, 4\)"):
        SavedPredictions(folder, "theirs").read(plan.tasks[0])


def test_an_array_whose_header_lies_or_that_would_be_unpickled_is_refused(plan: FramePlan, folder: Path):
    depth = folder / "N2/living/001.depth.npy"
    with depth.open("wb") as file:
        header = {"descr": "<f4", "fortran_order": False, "shape": (10**6, 10**6)}
        np.lib.format.write_array_header_1_0(file, header)
    with pytest.raises(InputError, match=r"001\.depth\.npy: expected an array of numbers, as long as its header says"):
        SavedPredictions(folder, "theirs").read(plan.tasks[0])
    np.save(depth, np.array([{"a": 1}]), allow_pickle=True)
    with pytest.raises(InputError, match=r"001\.depth\.npy: expected an array of numbers"):
        SavedPredictions(folder, "theirs").read(plan.tasks[0])


def test_a_label_outside_the_table_is_refused_naming_the_frame(plan: FramePlan, folder: Path):
    labels = np.full((36, 48), 255, np.uint8)
    labels[4, 7:9] = 20
    write_png(folder / "N2/living/002.png", labels)
    with pytest.raises(InputError) as caught:
        SavedPredictions(folder, "theirs").read(plan.tasks[1])
    assert "target images/002.png of living: expected labels 0..19 of table scannet20, or 255" in str(caught.value)
    assert "found 20 at 2 pixels" in str(caught.value)


def test_scenes_without_labels_ask_for_none(make_scene: MakeScene, tmp_path: Path):
    plan = make_plan(
        "n", neighbours, [make_scene("a", frames=3), make_scene("b", frames=3, labels=False)], (2,), (36, 48)
    )
    write_prediction(tmp_path, plan.tasks[0], Prediction(labels=torch.zeros(36, 48).byte()))
    SavedPredictions(tmp_path, "theirs").check(plan)


def test_the_numbers_of_views_are_read_off_the_folders(folder: Path, tmp_path: Path):
    (folder / "N12").mkdir()
    (folder / "Notes").mkdir()
    assert find_view_counts(folder) == (2, 3, 12)
    (tmp_path / "empty").mkdir()
    with pytest.raises(InputError, match="folders N2, N3"):
        find_view_counts(tmp_path / "empty")
