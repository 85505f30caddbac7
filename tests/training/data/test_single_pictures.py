"""Single pictures: all scenes of a folder take turns, and a batch is of as many scenes as it has pictures."""

from __future__ import annotations

from collections import Counter
from dataclasses import replace
from pathlib import Path

import pytest
import torch
from scenes_on_disk import write_labelled
from training_data import run_data, run_portions, run_validation

from semgs.training.data.data_settings import Augmentation
from semgs.training.data.samples import ImageSchedule, Turn, frame_of
from semgs.training.training_settings import TrainingSettings
from semgs_rooms.sets.pool import WINDOW, PooledSamples
from semgs_rooms.sets.room_stream import RoomSamples

SETTINGS = TrainingSettings(
    model="small_plain", steps=5, batch=4, size=(16, 24), supervision="pictures", seed=3,
    validation_scenes=2,
)  # fmt: skip


@pytest.fixture(scope="session")
def five(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A folder of five scenes of three frames, to be read alone."""
    folder = tmp_path_factory.mktemp("data") / "five"
    for number in range(5):
        write_labelled(folder / f"scene{number}", number, frames=3)
    return folder


def batches(settings: TrainingSettings, run: Path, start: int = 0) -> list:
    run.mkdir(exist_ok=True)
    portions = list(run_portions(settings, run, start))
    assert [portion.failure for portion in portions] == [None] * len(portions)
    return [batch for portion in portions for batch in portion.pieces]


def test_in_each_round_every_scene_has_one_turn_and_none_comes_twice_in_a_batch():
    turns = ImageSchedule(3, [1.0], [10], gap=7, length=70)
    scenes = [turns[k].scene for k in range(70)]
    assert all(sorted(scenes[start : start + 10]) == list(range(10)) for start in range(0, 70, 10))
    assert all(len(set(scenes[start : start + 7])) == 7 for start in range(64))  # also where rounds meet
    assert scenes[:10] != scenes[10:20]
    assert [turns[k].round for k in (0, 9, 10, 69)] == [0, 0, 1, 6]


def test_with_fewer_scenes_than_a_batch_all_come_before_one_comes_again():
    turns = ImageSchedule(3, [1.0], [3], gap=16, length=30)
    scenes = [turns[k].scene for k in range(30)]
    assert all(len(set(scenes[start : start + 3])) == 3 for start in range(28))


def test_sources_come_by_their_weights_in_every_batch():
    turns = ImageSchedule(3, [3.0, 1.0], [0, 6], gap=16, length=320)
    for start in range(0, 320, 16):
        counts = Counter(turns[k].source for k in range(start, start + 16))
        assert abs(counts[0] - 12) <= 1, "three quarters of 16, to one"
    assert all(turns[k].scene == k for k in range(320) if turns[k].source == 0)  # it does not run out of scenes
    seen = Counter(turns[k].scene for k in range(320) if turns[k].source == 1)
    assert max(seen.values()) - min(seen.values()) <= 1


def test_a_turn_depends_on_seed_and_number_alone():
    long, late = (ImageSchedule(3, [1.0, 2.0], [5, 9], 4, length) for length in (300, 200))
    assert late[150] == long[150]  # asked for first, and of a shorter run
    assert [long[k] for k in range(40)] == [late[k] for k in range(40)]
    assert [ImageSchedule(4, [1.0, 2.0], [5, 9], 4, 40)[k] for k in range(40)] != [long[k] for k in range(40)]


def test_a_scene_shows_each_of_its_frames_before_one_comes_again():
    frames = [frame_of(3, Turn(0, 2, number), 5) for number in range(10)]
    assert sorted(frames[:5]) == [0, 1, 2, 3, 4]
    assert frames[5:] == frames[:5]


def test_a_batch_holds_one_picture_of_each_scene_and_nothing_to_compare_with(five: Path, tmp_path: Path):
    settings = replace(
        SETTINGS, data=(str(five),), augmentation=Augmentation(crop=0.5, flip=True, roll=20.0, camera=1.0)
    )
    whole, rest = batches(settings, tmp_path / "a"), batches(settings, tmp_path / "b", start=3)
    for batch in whole:
        assert batch.context.images.shape == (4, 1, 3, 16, 24)
        assert batch.target.images.shape == (4, 0, 3, 16, 24)
        assert batch.taught is None
        assert len(set(batch.scenes)) == 4
        assert (batch.context.depths == 0).all()  # depth is not read
        assert (batch.context.labels == 255).float().mean() < 0.5
    assert Counter(name for batch in whole for name in batch.scenes) == {f"scene{n}": 4 for n in range(5)}
    assert [one.scenes for one in whole[3:]] == [one.scenes for one in rest]
    assert all(torch.equal(a.context.images, b.context.images) for a, b in zip(whole[3:], rest, strict=True))


def test_the_first_steps_have_half_the_size_and_validation_never(five: Path, tmp_path: Path):
    settings = replace(SETTINGS, data=(str(five),), size=(32, 48), half_size=0.6, validation=str(five))
    found = batches(settings, tmp_path / "run")
    assert [batch.context.images.shape[-2:] for batch in found] == [(16, 24)] * 3 + [(32, 48)] * 2
    resumed = batches(settings, tmp_path / "again", start=2)
    assert all(torch.equal(a.context.images, b.context.images) for a, b in zip(found[2:], resumed, strict=True))
    scored = run_validation(settings, tmp_path / "run")
    assert all(batch.context.images.shape[-2:] == (32, 48) for batch in scored)


def test_validation_shows_one_picture_of_each_scene(five: Path, tmp_path: Path):
    settings = replace(SETTINGS, data=("rooms",), validation=str(five), validation_scenes=5)
    found = run_validation(settings, tmp_path)
    assert {name for batch in found for name in batch.scenes} == {f"scene{n}" for n in range(5)}
    assert all(batch.context.images.shape == (1, 1, 3, 16, 24) for batch in found)


def test_a_scene_that_breaks_gives_its_turn_to_another(tmp_path: Path):
    folder = tmp_path / "scans"
    for number in range(4):
        write_labelled(folder / f"scene{number}", number, frames=2)
    settings = replace(SETTINGS, data=(str(folder),), batch=4, steps=1)
    run = tmp_path / "run"
    run.mkdir()
    data = run_data(settings, run)
    for picture in (folder / "scene2" / "images").iterdir():
        picture.unlink()
    (portion,) = run_portions(settings, run, data=data)
    assert len(portion.pieces[0].scenes) == 4
    assert "scene2" not in portion.pieces[0].scenes
    assert len(portion.bad) == 1


def test_live_rooms_come_one_picture_each(tmp_path: Path):
    (batch,) = batches(replace(SETTINGS, data=("rooms",), steps=1, batch=2), tmp_path)
    assert batch.context.images.shape == (2, 1, 3, 16, 24)
    assert batch.scenes == ("room 3/0", "room 3/1")


def test_a_pooled_scene_serves_no_two_single_pictures_of_a_batch(tmp_path: Path):
    pool = PooledSamples(tmp_path, RoomSamples(3, (16, 24), 1, 0, length=320, group=16))
    scenes = [pool.choice(k)[0] for k in range(320)]
    assert all(len(set(scenes[start : start + 16])) == 16 for start in range(0, 320, 16))
    assert all(0 <= scene - k // 16 * 2 < WINDOW for k, scene in enumerate(scenes))


@pytest.mark.parametrize(
    ("change", "told"),
    [
        ({"contexts": (1, 1)}, "contexts is"),
        ({"contexts": (1, 2)}, "contexts is"),
        ({"targets": 0}, "targets is"),
        ({"supervision": "labels", "augmentation": Augmentation(roll=5.0)}, "augmentation.roll is 5.0; expected 0"),
        (
            {"supervision": "rendered", "augmentation": Augmentation(exposure=0.1)},
            "augmentation.exposure is 0.1; expected 0",
        ),
        ({"sampling": "balanced"}, "take turns"),
        ({"half_size": 0.5}, "0 if a side is below 32 pixels"),
        ({"half_size": 1.5, "size": (32, 48)}, "half_size is 1.5; expected a share in 0..1"),
        ({"teacher": "somewhere", "supervision": "labels"}, "supervision pictures"),
        ({"teacher_weight": 0.0}, "teacher_weight is"),
    ],
)
def test_what_needs_single_pictures_or_cannot_have_them_is_refused(change: dict, told: str):
    with pytest.raises(ValueError, match=told):
        replace(SETTINGS, **change)
