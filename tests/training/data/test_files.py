"""Trainings on scenes from files: which samples, what of bad scenes, which classes."""

from __future__ import annotations

import json
from collections import Counter
from dataclasses import replace
from fractions import Fraction
from pathlib import Path

import numpy as np
import pytest
import torch
from scenes_on_disk import labelled_views, unlabel, write_labelled, write_table
from training_data import run_data, run_portions, run_validation

from semgs.data.scenes import open_scene
from semgs.data.tables.class_files import read_class_file
from semgs.data.tables.classes import IGNORE, SCANNET20
from semgs.data.views import Batch
from semgs.evaluation.frames import protocols
from semgs.evaluation.frames.frame_plan import Task
from semgs.evaluation.frames.reading import read_frame
from semgs.files.errors import InputError
from semgs.training.data.batches import Portion, training_batches
from semgs.training.data.data_check.counts import inverse_frequency
from semgs.training.data.data_check.open_sources import check_bad
from semgs.training.data.data_settings import Augmentation, Source
from semgs.training.data.samples import Folder, Form, Mixture, Samples, convert_labels, fill_missing_maps
from semgs.training.loop import Feed, fit
from semgs.training.run.session import BadScenes, Session
from semgs.training.training_settings import TrainingSettings

SETTINGS = TrainingSettings(model="small_plain", steps=4, batch=2, size=(16, 24), contexts=(2, 3), targets=2, seed=3)


@pytest.fixture(scope="session")
def scans(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A folder of three scenes, to be read alone."""
    folder = tmp_path_factory.mktemp("data") / "scans"
    for number, labels in enumerate([(0, 1), (0, 1), (0, 9)]):
        write_labelled(folder / f"scene{number}", number, labels=labels)
    return folder


def portions(settings: TrainingSettings, run: Path, start: int = 0) -> list[Portion]:
    run.mkdir(exist_ok=True)
    return list(run_portions(settings, run, start))


def batches(settings: TrainingSettings, run: Path, start: int = 0) -> list[Batch]:
    return [batch for portion in portions(settings, run, start) for batch in portion.pieces]


def test_step_k_sees_the_same_scenes_and_frames_wherever_the_run_began(scans, tmp_path):
    settings = replace(
        SETTINGS, data=(str(scans),), augmentation=Augmentation(colour=0.2, crop=0.6, flip=True), batch=3
    )
    whole, rest = batches(settings, tmp_path / "a"), batches(settings, tmp_path / "b", start=2)
    assert [one.scenes for one in whole[2:]] == [one.scenes for one in rest]
    for a, b in zip(whole[2:], rest, strict=True):
        assert torch.equal(a.context.images, b.context.images)
        assert torch.equal(a.target.labels, b.target.labels)
        assert torch.equal(a.target.cameras.intrinsics, b.target.cameras.intrinsics)
    assert {len(one.context) for one in whole} <= {2, 3}
    assert {len(one.target) for one in whole} == {2}
    assert all(one.context.size == (16, 24) for one in whole)
    assert len({scene for one in whole for scene in one.scenes}) > 1


def test_another_seed_sees_other_scenes_and_frames(scans, tmp_path):
    def seen(seed: int) -> list[tuple[tuple[str, ...], list]]:
        found = batches(replace(SETTINGS, data=(str(scans),), steps=2, seed=seed), tmp_path)
        return [(one.scenes, one.context.cameras.centres.tolist()) for one in found]

    assert all(one != other for one, other in zip(seen(3), seen(4), strict=True))


def test_a_sample_holds_frames_of_its_scene_with_their_cameras(scans, tmp_path):
    for one in batches(replace(SETTINGS, data=(str(scans),)), tmp_path):
        for index, name in enumerate(one.scenes):
            there = labelled_views(int(name.removeprefix("scene"))).cameras.centres
            here = torch.cat((one.context.cameras.centres[index], one.target.cameras.centres[index]))
            distances = torch.cdist(here, there)
            assert distances.amin(1).max() < 1e-6
            assert len(set(distances.argmin(1).tolist())) == len(here), "no frame comes twice"


def test_consecutive_samples_are_a_frame_and_those_around_it_in_training_and_validation(scans, tmp_path):
    settings = replace(
        SETTINGS, data=(str(scans),), validation=str(scans), contexts=(2, 2), targets=1, steps=8, frames="consecutive"
    )
    samples = [*batches(settings, tmp_path), *run_validation(settings, tmp_path)]
    assert len(samples) > 8
    for one in samples:
        for index, name in enumerate(one.scenes):
            there = labelled_views(int(name.removeprefix("scene"))).cameras.centres
            here = torch.cat((one.context.cameras.centres[index], one.target.cameras.centres[index]))
            first, second, target = torch.cdist(here, there).argmin(1).tolist()
            assert (first, second) == (target - 1, target + 1)


def test_a_mixture_draws_its_sources_by_their_weights_and_stays_a_function_of_k(scans, tmp_path, monkeypatch):
    def drawn(self, k):
        views = labelled_views(k + 100, frames=5)
        contexts, targets = self.counts(k)
        return views.select(range(contexts)), views.select(range(contexts, contexts + targets))

    monkeypatch.setattr("semgs_rooms.training_rooms.RoomSamples.__getitem__", drawn)
    settings = replace(SETTINGS, data=("rooms=3", f"{scans}=1"), steps=24)
    whole, rest = batches(settings, tmp_path), batches(settings, tmp_path, start=20)
    scenes = [scene for one in whole for scene in one.scenes]
    share = sum(scene.startswith("room 3/") for scene in scenes) / len(scenes)
    assert 0.55 < share < 0.95  # 3 of 4; 48 draws scatter by 0.06
    assert [one.scenes for one in rest] == [one.scenes for one in whole[20:]]
    assert any(scenes[0].startswith("room") != scenes[1].startswith("room") for scenes in (one.scenes for one in whole))


def test_a_scene_that_breaks_is_passed_over_told_once_and_counted(tmp_path):
    for number in range(4):
        write_labelled(tmp_path / "data" / f"scene{number}", number, frames=5)
    broken = tmp_path / "data" / "scene2" / "images"
    for picture in broken.iterdir():
        picture.write_bytes(picture.read_bytes()[: picture.stat().st_size * 2 // 3])
    settings = replace(SETTINGS, data=(str(tmp_path / "data"),), steps=8)
    found = portions(settings, tmp_path / "run")
    assert Counter(path for portion in found for path, _ in portion.bad).keys() == {
        str(broken.parent / "transforms.json")
    }
    assert all("scene2" not in scene for portion in found for one in portion.pieces for scene in one.scenes)
    told: list[str] = []
    bad = BadScenes(30, told.append, [])
    for portion in found:
        bad.add(portion.bad)
    assert len(bad) == 1
    assert len(told) == 1
    assert "scene2" in told[0]


def test_more_than_5_percent_bad_scenes_end_a_training():
    check_bad([("a", "cut short")], 20)
    with pytest.raises(InputError, match=r"a: expected at most 5% bad scenes, found 2 of 39; of this one: cut short"):
        check_bad([("a", "cut short"), ("b", "gone")], 39)


def test_bad_scenes_that_a_worker_found_end_the_loop(network, batch, settings, tmp_path):
    from semgs.training.state import TrainingState
    from semgs.training.supervision.supervision import make_supervision

    state = TrainingState.begin(network(), make_supervision(settings), settings.learning_rate, settings.average_decay)
    seen = [Portion((batch(0),)), Portion((batch(1),), bad=(("x", "cut short"),)), Portion((batch(2),))]
    with pytest.raises(InputError, match="bad scenes"):
        fit(state, settings, tmp_path, Feed(seen, scenes=19), Session())
    assert state.step == 1
    with pytest.raises(InputError, match="expected air"):
        fit(state, settings, tmp_path, Feed([Portion((), failure=InputError("x", "air", "none"))]), Session())


def test_a_training_needs_scenes_with_as_many_frames_as_a_sample(scans, tmp_path):
    settings = replace(SETTINGS, data=(str(scans),), contexts=(2, 5))
    with pytest.raises(InputError, match=r"found 3 of 3; of this one: .*at least 7 usable frames .* found 6"):
        run_data(settings, tmp_path)


def test_a_folder_without_scenes_is_refused(tmp_path):
    with pytest.raises(InputError, match="a scene or a folder of scenes"):
        run_data(replace(SETTINGS, data=(str(tmp_path),)), tmp_path)


def test_scenes_without_labels_are_refused_unless_classes_are_not_learned_or_others_have_some(scans, tmp_path):
    plain = write_labelled(tmp_path / "plain", 5, change=unlabel)
    settings = replace(SETTINGS, data=(str(plain),))
    with pytest.raises(InputError, match=r"--losses.semantic 0"):
        run_data(settings, tmp_path)
    with pytest.raises(InputError, match=r"--supervision rendered"):
        run_data(replace(settings, supervision="labels"), tmp_path)
    blind = replace(settings, losses=replace(settings.losses, semantic=0.0, smoothness=0.0))
    (first, *_) = batches(blind, tmp_path / "blind")
    assert (first.target.labels == IGNORE).all()
    mixed = run_data(replace(SETTINGS, data=(str(plain), str(scans))), tmp_path)
    assert mixed.notes == ("1 of 4 scenes have no labels and only teach colour",)


def test_scenes_without_depth_are_refused_by_name_if_depth_is_learned_wherever_they_are(scans, tmp_path):
    def bare(scene: dict) -> None:
        for frame in scene["frames"]:
            del frame["depth_file_path"]

    plain = write_labelled(tmp_path / "plain", 5, change=bare)
    settings = replace(SETTINGS, data=(str(scans), str(plain)), supervision="depth", validation_scenes=2)
    with pytest.raises(InputError, match=r"plain.*with depth.*1 of 4 scenes.*leave them out, or give --supervision"):
        run_data(settings, tmp_path)
    with pytest.raises(InputError, match=r"plain.*with depth.*1 of 1 scenes"):
        run_data(replace(settings, data=(str(scans),), validation=str(plain)), tmp_path)
    assert run_data(replace(settings, supervision="rendered"), tmp_path).scenes == 4


def test_depth_is_learned_from_scenes_whose_labels_are_of_any_table_or_missing(tmp_path):
    write_table(tmp_path / "three.json")
    own = write_labelled(tmp_path / "own", 6, change=lambda scene: scene.update(label_set="../three.json"))
    plain = write_labelled(tmp_path / "plain", 5, change=unlabel)
    settings = replace(SETTINGS, data=(str(own), str(plain)), supervision="depth")
    found = run_data(settings, tmp_path)
    assert (found.scenes, found.notes) == (2, ())
    assert all((one.context.depths > 0).any() for one in batches(settings, tmp_path / "run"))


def test_a_run_does_not_go_on_with_other_scenes_but_does_elsewhere(scans, tmp_path):
    settings = replace(SETTINGS, data=(str(scans),))
    run_data(settings, tmp_path)
    write_labelled(tmp_path / "more" / "scene0", 0)
    with pytest.raises(InputError, match=r"the 3 scenes that the run started with, found 1, of which scene1 differs"):
        run_data(replace(settings, data=(str(tmp_path / "more"),)), tmp_path)


@pytest.mark.parametrize(
    ("rule", "power"), [("inverse_root_frequency", 1 / 2), ("inverse_fourth_root_frequency", 1 / 4)]
)
def test_weights_of_classes_are_measured_in_the_data(rule, power, scans, tmp_path):
    settings = replace(SETTINGS, data=(str(scans),), class_weights=rule)
    found = run_data(settings, tmp_path).class_weights
    # Half of each scene is wall; two scenes of three have floor beside it, the third bookshelf.
    shares = np.zeros(20)
    shares[[0, 1, 9]] = 1 / 2, 1 / 3, 1 / 6
    assert found == pytest.approx(inverse_frequency(shares, power), rel=0.05)
    record = json.loads((tmp_path / "data.json").read_text())
    assert [scene["name"] for scene in record["scenes"]] == ["scene0", "scene1", "scene2"]
    record["scenes"][2]["pixels"] = [0.0] * 20
    (tmp_path / "data.json").write_text(json.dumps(record))
    assert run_data(settings, tmp_path).class_weights != found, "what was measured once is kept"


def test_counting_classes_looks_for_no_depth_in_the_images(scans, tmp_path, monkeypatch):
    """To look for matches in a thousand scenes would take minutes."""
    monkeypatch.setattr("semgs.data.bounds.depth_range.find_features", lambda frame: pytest.fail("features are found"))
    settings = replace(SETTINGS, data=(str(scans),), class_weights="inverse_root_frequency")
    assert run_data(settings, tmp_path).class_weights


def test_a_mean_pixel_has_weight_one_and_a_class_never_seen_that_of_the_rarest():
    shares = np.array([0.64, 0.0, 0.32, 0.04])
    for power in (1 / 2, 1 / 4):
        weights = np.array(inverse_frequency(shares, power))
        assert (weights * shares).sum() / shares.sum() == pytest.approx(1, abs=1e-3)
        assert weights[3] / weights[0] == pytest.approx(16**power, rel=1e-3)
        assert weights[1] == weights[3]


def test_balanced_sampling_prefers_scenes_with_rare_classes(scans, tmp_path):
    even = run_data(replace(SETTINGS, data=(str(scans),)), tmp_path / "a") if (tmp_path / "a").mkdir() is None else None
    (tmp_path / "b").mkdir()
    balanced = run_data(replace(SETTINGS, data=(str(scans),), sampling="balanced"), tmp_path / "b")
    assert even is not None
    assert even.folders[0].chances == pytest.approx([1 / 3] * 3)
    first, second, third = balanced.folders[0].chances
    assert first == pytest.approx(second, rel=0.1)
    assert third > 1.2 * first
    with pytest.raises(InputError, match="only rooms"):
        run_data(replace(SETTINGS, sampling="balanced"), tmp_path)


def test_labels_are_brought_to_another_table_by_name(tmp_path):
    table = read_class_file(write_table(tmp_path / "three.json")).table
    views = labelled_views(1, labels=(0, 1, 4))
    there = convert_labels(views, table)
    assert there.classes == table
    assert torch.equal(there.labels == 0, views.labels == SCANNET20.index("wall"))
    assert torch.equal(there.labels == 2, views.labels == SCANNET20.index("floor"))
    assert torch.equal(there.labels == IGNORE, views.labels == SCANNET20.index("chair"))
    bare = fill_missing_maps(replace(views, labels=None, depths=None))
    assert (bare.labels == IGNORE).all()
    assert (bare.depths == 0).all()


def test_scenes_of_another_table_need_one_to_be_named(scans, tmp_path):
    write_table(tmp_path / "three.json")
    own = write_labelled(tmp_path / "own", 6, change=lambda scene: scene.update(label_set="../three.json"))
    with pytest.raises(InputError, match=r"labels of class table scannet20, found labels of three; .*--classes FILE"):
        run_data(replace(SETTINGS, data=(str(own),)), tmp_path)
    table = read_class_file(tmp_path / "three.json").table
    settings = replace(SETTINGS, data=(str(own), str(scans)), classes=table)
    found = run_data(settings, tmp_path)
    assert found.notes == (
        "labels of scannet20: 2 of 20 classes are in three; pixels of the other classes are ignored",
        "labels of rooms: 2 of 20 classes are in three; pixels of the other classes are ignored",
    )
    assert all(one.target.classes == table for one in batches(settings, tmp_path / "run"))


def test_validation_scenes_come_from_a_folder_if_asked(scans, tmp_path):
    settings = replace(SETTINGS, data=(str(scans),), validation=str(scans), validation_scenes=3)
    found = run_validation(settings, tmp_path)
    assert [len(one.context) for one in found] == [2, 2, 2]
    assert {scene for one in found for scene in one.scenes} <= {"scene0", "scene1", "scene2"}


def test_validation_rooms_have_the_fewest_input_views_of_the_training(tmp_path, monkeypatch):
    def drawn(self, k):
        contexts, targets = self.counts(k)
        return labelled_views(k).select(range(contexts)), labelled_views(k).select(range(contexts, contexts + targets))

    monkeypatch.setattr("semgs_rooms.training_rooms.RoomSamples.__getitem__", drawn)
    settings = replace(SETTINGS, contexts=(2, 4), validation_scenes=12)
    found = run_validation(settings, tmp_path)
    assert [len(one.context) for one in found] == 12 * [2]
    assert [len(one.target) for one in found] == 12 * [2]


def test_a_pool_of_rooms_keeps_those_that_workers_may_still_read(tmp_path, monkeypatch):
    # Three workers with four steps each, the step that is being taken, and one by which processes may differ: 14 steps of 4 scenes.
    made = []
    monkeypatch.setattr("semgs_rooms.training_rooms.pooled", lambda *args, ahead: made.append(ahead))
    monkeypatch.setattr("semgs.training.data.batches.DataLoader", lambda *args, **options: None)
    settings = replace(SETTINGS, scene_reuse=2, batch=4)
    training_batches(settings, run_data(settings, tmp_path), 4, pool=tmp_path / "pool", workers=3)
    assert made == [56]


def test_validation_scenes_are_looked_at_before_the_first_step(scans, tmp_path):
    write_table(tmp_path / "three.json")
    write_labelled(tmp_path / "own" / "a", 6, change=lambda scene: scene.update(label_set="../../three.json"))
    write_labelled(tmp_path / "short" / "a", 6, frames=3)
    settings = replace(SETTINGS, data=(str(scans),))
    with pytest.raises(InputError, match="found labels of three"):
        run_data(replace(settings, validation=str(tmp_path / "own")), tmp_path)
    with pytest.raises(InputError, match="at least 4 usable frames"):
        run_data(replace(settings, validation=str(tmp_path / "short")), tmp_path)


def test_sources_are_paths_with_weights():
    assert Source.parsed("rooms") == Source("rooms", Fraction(1))
    assert Source.parsed("a/b=0.25") == Source("a/b", Fraction(1, 4))
    assert float(Source.parsed("scans=1e-1").weight) == 0.1
    assert Source.parsed("odd=name/scans").path == "odd=name/scans"
    for text in ("a=0", "a=-1", "a=much", "=2", ""):
        with pytest.raises(ValueError, match="expected rooms or DIR, optionally with =WEIGHT"):
            Source.parsed(text)


def test_samples_and_frames_of_a_scene_far_from_its_origin_are_near_one(tmp_path):
    """Six million metres away, as a float32 with steps of half a metre would tell."""

    def far(scene: dict) -> None:
        for frame in scene["frames"]:
            frame["transform_matrix"][0][3] += 6e6

    drawn = []
    for name, change in (("near", lambda scene: None), ("far", far)):
        folder = write_labelled(tmp_path / name, 1, change=change)
        samples = Samples(3, Mixture(None, (Folder((folder,)),), (1.0,)), Form(SETTINGS.size, (2, 2), 1, SCANNET20), 1)
        drawn.append(samples[0])
        scene = open_scene(folder)
        frame = read_frame(Task(scene, SETTINGS.size, protocols.TargetSample((0, 1), 2)), 2, (0.5, 10.0))
        assert torch.equal(frame.cameras.centres[0], scene.cameras[2].centres - torch.from_numpy(scene.origin))
        assert frame.cameras.centres.abs().max() < 100
    before, after = (torch.cat((one.context.cameras.centres, one.target.cameras.centres)) for one in drawn)
    assert torch.equal(drawn[0].context.images, drawn[1].context.images)
    assert after.abs().max() < 100
    torch.testing.assert_close(after - after[0], before - before[0], rtol=0, atol=1e-8)


@pytest.mark.parametrize("supervision", ["rendered", "labels"])
def test_scenes_in_which_no_pixel_has_a_label_are_refused(tmp_path: Path, supervision: str):
    """255 everywhere; with one labelled scene beside it, classes can be learned."""
    write_labelled(tmp_path / "scans/a", 0, labels=(255, 255))
    settings = replace(SETTINGS, data=(str(tmp_path / "scans"),), supervision=supervision)
    with pytest.raises(InputError, match="label maps in which no pixel has a label; "):
        run_data(settings, tmp_path)
    write_labelled(tmp_path / "scans/b", 1, labels=(255, 3))
    assert run_data(settings, tmp_path).scenes == 2
