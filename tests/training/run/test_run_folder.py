"""Run folders and settings."""

from __future__ import annotations

import json
import subprocess
import sys
from dataclasses import replace
from pathlib import Path

import pytest

from semgs.cli.main import main
from semgs.data import demo_scene as demo
from semgs.data.tables.classes import SCANNET20
from semgs.files.errors import InputError
from semgs.model.switches import Switches
from semgs.model.weights.load import load
from semgs.model.weights.weights_file import read_header
from semgs.objectives.loss_weights import DepthLossWeights, LossWeights
from semgs.training.data.data_settings import VALIDATION_SEED, Augmentation
from semgs.training.loop import train
from semgs.training.presets import PRESETS, preset_changes
from semgs.training.run.checkpoints import Checkpoint, save_checkpoint
from semgs.training.run.execution import Execution
from semgs.training.run.run_folder import (
    BEST,
    NETWORK,
    WEIGHTS,
    claim_folder,
    empty_network,
    export_weights,
    is_finished,
    lock_run,
    read_settings,
    record_weights,
    start_run,
)
from semgs.training.state import TrainingState
from semgs.training.supervision.supervision import make_supervision
from semgs.training.training_settings import TrainingSettings, differences, find_changes, list_changes


def begin(run: Path) -> None:
    """Give a run a checkpoint, by which it has begun."""
    (run / "checkpoints").mkdir()
    (run / "checkpoints" / "00000001.json").touch()


@pytest.mark.parametrize("name", PRESETS)
def test_settings_survive_json(name: str, tmp_path):
    settings = replace(PRESETS[name](), class_weights=(1.0,) * 20)
    claim_folder(tmp_path / "run", settings)
    assert read_settings(tmp_path / "run") == settings
    own = replace(
        settings, classes=replace(SCANNET20, name="own"), class_weights="inverse_root_frequency", data=("rooms=2", "a"),
        augmentation=Augmentation(crop=0.5), network=Switches(windows=1), losses=LossWeights(smoothness=0.0),
        depth_losses=DepthLossWeights(gradients=0.0),
    )  # fmt: skip
    claim_folder(tmp_path / "own", own)
    assert read_settings(tmp_path / "own") == own


def test_a_run_that_began_before_some_settings_existed_goes_on(tmp_path):
    """They have their defaults then."""
    (tmp_path / "settings.json").write_text(
        """{"model": "small_plain", "steps": 12000, "batch": 2, "size": [96, 128], "contexts": [2, 3], "targets": 2,
        "context_targets": true, "learning_rate": 0.001, "warmup": 0.05, "clip": 0.5, "average_decay": 0.998,
        "losses": {"semantic": 0.1, "colour": 1.0, "smoothness": 0.001}, "class_weights": null, "depth_weight": 0.1,
        "init": "random", "seed": 0, "scene_reuse": 1, "validate_every": 1000,
        "validation_scenes": 16}"""
    )
    claim_folder(tmp_path, PRESETS["small_plain"]())


def test_data_weights_and_assets_may_lie_elsewhere_on_another_machine(settings, tmp_path):
    here = replace(settings, data=("rooms", "/data/scans=2"), init="/w/mine.safetensors")
    claim_folder(tmp_path, here)
    begin(tmp_path)
    claim_folder(tmp_path, replace(here, data=("rooms", "../scans=2"), init="mine.safetensors"))
    for change in ({"data": ("rooms", "/data/scans=3")}, {"data": ("rooms", "/data/others=2")}, {"init": "random"}):
        with pytest.raises(ValueError, match=next(iter(change))):
            claim_folder(tmp_path, replace(here, **change))


def test_weights_that_every_run_calls_alike_are_told_apart_by_its_name_and_ids_of_a_hub_by_all_of_it(
    settings, tmp_path
):
    for here, elsewhere, other in (
        ("runs/a/weights.safetensors", "/moved/a/weights.safetensors", "runs/b/weights.safetensors"),
        ("hf://alice/semgs", "hf://alice/semgs", "hf://bob/semgs"),
        ("weights.safetensors", "runs/a/weights.safetensors", "best.safetensors"),
    ):
        began = replace(settings, init=here)
        assert find_changes(replace(settings, init=elsewhere), began) == {}
        assert find_changes(replace(settings, init=other), began) == {"init": (other, here)}


def test_a_run_is_finished_after_its_last_step_and_the_validation_that_is_due(settings, tmp_path, monkeypatch):
    claim_folder(tmp_path, replace(settings, steps=12))
    for numbers, finished in (
        ({"step": 11}, False), ({"step": 12}, True), ({"step": 12, "validation_due": 1}, False),
    ):  # fmt: skip
        newest = Checkpoint({}, numbers, ())
        monkeypatch.setattr("semgs.training.run.run_folder.newest_checkpoint", lambda folder, newest=newest: newest)
        assert is_finished(tmp_path) is finished


def test_a_run_of_other_settings_is_refused_with_the_difference(settings, tmp_path):
    claim_folder(tmp_path, settings)
    begin(tmp_path)
    claim_folder(tmp_path, settings)
    with pytest.raises(
        InputError, match=r"other settings: batch = 2 there, 3 requested; .*\(steps may grow, and .* keep their names\)"
    ):
        claim_folder(tmp_path, replace(settings, batch=3, steps=13))
    with pytest.raises(ValueError, match=r"steps = 12 there, 11 requested"):
        claim_folder(tmp_path, replace(settings, steps=11))


def test_a_run_becomes_longer_once_somebody_trains_it_and_then_not_shorter(settings, tmp_path):
    claim_folder(tmp_path, settings)
    begin(tmp_path)
    longer = replace(settings, steps=20)
    claim_folder(tmp_path, longer)
    assert read_settings(tmp_path) == settings
    with lock_run(tmp_path):
        start_run(tmp_path, longer)
        assert read_settings(tmp_path) == longer
        with pytest.raises(InputError, match=r"steps = 20 there, 12 requested"):
            start_run(tmp_path, settings)
        with pytest.raises(InputError, match="another process is training"), lock_run(tmp_path):
            pass
    assert read_settings(tmp_path) == longer
    with pytest.raises(ValueError, match=r"steps = 20 there, 12 requested"):
        claim_folder(tmp_path, settings)


def test_a_folder_of_something_else_is_refused(settings, tmp_path):
    (tmp_path / "thesis.tex").write_text("mine")
    with pytest.raises(InputError, match="something else"):
        claim_folder(tmp_path, settings)
    with pytest.raises(InputError, match="no such file"):
        read_settings(tmp_path)


def test_a_start_that_was_killed_at_once_does_not_block_the_next(settings, tmp_path):
    (tmp_path / ".settings.json.1a2b3c4d.part").write_text("{")
    claim_folder(tmp_path, settings)
    assert read_settings(tmp_path) == settings


def test_a_run_that_learned_nothing_is_taken_over_with_nothing_of_what_it_recorded(settings, tmp_path):
    """Its user mistyped an input, or it was killed before its first checkpoint: the settings, data and weights may be others now."""
    run, file = tmp_path / "run", tmp_path / "start.safetensors"
    file.write_text("abc")
    claim_folder(run, replace(settings, backbone="nope", steps=20))
    for name in (NETWORK, "data.json", "assets.json", "backbone.json"):
        (run / name).write_text('"stale"')
    (run / "rooms").mkdir()
    (run / "checkpoints").mkdir()
    (run / "checkpoints" / "00000001.safetensors").touch()  # half a checkpoint
    (run / "notes.txt").write_text("mine")
    wanted = replace(settings, init=str(file))
    claim_folder(run, wanted)
    assert read_settings(run).backbone == "nope"  # until a process has the lock
    with lock_run(run):
        start_run(run, wanted)
    assert read_settings(run) == wanted
    assert json.loads((run / "init.json").read_text()) == ABC
    assert {path.name for path in run.iterdir()} == {"settings.json", "init.json", "checkpoints", "notes.txt", ".lock"}


@pytest.mark.parametrize("kept", ["checkpoints/00000001.json", WEIGHTS, BEST])
def test_a_run_that_learned_something_is_never_taken_over(settings, tmp_path, kept: str):
    claim_folder(tmp_path, settings)
    (tmp_path / kept).parent.mkdir(exist_ok=True)
    (tmp_path / kept).touch()
    for refuse in (claim_folder, start_run):
        with pytest.raises(InputError, match="seed = 3 there, 4 requested"):
            refuse(tmp_path, replace(settings, seed=4))
    assert read_settings(tmp_path) == settings


def test_a_folder_with_settings_of_another_program_is_not_taken_over(settings, tmp_path):
    (tmp_path / "settings.json").write_text('{"editor.fontSize": 12}')
    with pytest.raises(InputError, match="expected the settings of a training run"):
        claim_folder(tmp_path, settings)


def test_a_run_without_a_checkpoint_has_no_weights(settings, tmp_path):
    claim_folder(tmp_path, settings)
    with pytest.raises(InputError, match="train first"):
        export_weights(tmp_path)


def test_unknown_fields_of_a_newer_version_are_named(settings):
    with pytest.raises(ValueError, match="does not know curriculum"):
        TrainingSettings.from_json({**settings.as_json(), "curriculum": True})


@pytest.mark.parametrize(
    ("field", "value"),
    [
        ("seed", VALIDATION_SEED),
        ("seed", demo.SEED),
        ("seed", -1),
        ("steps", 0),
        ("contexts", (1, 2)),
        ("contexts", (4, 2)),
        ("warmup", 0.0),
        ("size", (8, 320)),
    ],
)
def test_settings_that_cannot_be_are_refused_by_name(settings, field: str, value: object):
    with pytest.raises(ValueError, match=f"{field} is"):
        replace(settings, **{field: value})


def test_an_empty_value_is_printed_as_none(settings):
    changes = differences(replace(settings, backbone="nope", data=()), replace(settings, class_weights=(1.0,) * 20))
    told = list_changes(changes, "requested")
    assert "backbone = none there, nope requested" in told
    assert "data = ('rooms',) there, none requested" in told
    assert "1.0) there, none requested" in told
    assert preset_changes(replace(PRESETS["small"](), backbone="nope")) == ["backbone: nope (preset small: none)"]


def test_differences_name_both_values(settings):
    assert differences(replace(settings, batch=5), settings) == {"batch": (5, 2)}


@pytest.mark.long
def test_a_folder_that_another_process_trains_into_is_refused_until_that_ends(settings, tmp_path):
    out = tmp_path / "run"
    claim_folder(out, settings)
    hold = "import sys, pathlib; from semgs.training.run.run_folder import lock_run\nwith lock_run(pathlib.Path(sys.argv[1])): print('held', flush=True); input()"
    with subprocess.Popen(
        [sys.executable, "-c", hold, str(out)], stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True
    ) as other:
        assert other.stdout is not None
        assert other.stdout.readline() == "held\n"
        before = {file: file.read_bytes() for file in out.iterdir()}
        with pytest.raises(InputError, match="another process is training"):
            train(settings, out, Execution(workers=0))
        assert {file: file.read_bytes() for file in out.iterdir()} == before
        other.kill()
    with lock_run(out):
        pass


def test_weights_are_written_with_one_read_of_each_checkpoint_that_is_needed(
    tmp_path: Path, checkpoint_reads: list[int]
):
    """Of steps 3, 4 and 6, the last is the newest and 3 the best validation; then 6 is both."""
    settings = TrainingSettings(model="small_plain", steps=6)
    model = load("small_plain", "random")
    state = TrainingState.begin(model, make_supervision(settings), 1e-3, 0.9)
    claim_folder(tmp_path, settings)
    (tmp_path / NETWORK).write_text(json.dumps(model.settings.as_json()))
    bias = next(name for name, _ in model.named_parameters() if name.endswith("bias"))
    for state.step, state.best_step, state.best_score in ((3, 3, 0.5), (4, 3, 0.5), (6, 3, 0.5)):
        state.average.module.get_parameter(bias).data.fill_(state.step)
        save_checkpoint(tmp_path / "checkpoints", state)
    for best in (3, 6):
        state.best_step = best
        save_checkpoint(tmp_path / "checkpoints", state)
        checkpoint_reads.clear()
        export_weights(tmp_path)
        assert checkpoint_reads == ([6, 3] if best == 3 else [6])
        for name, step in ((WEIGHTS, 6), (BEST, best)):
            assert read_header(tmp_path / name).metadata["step"] == str(step)
            assert (load("small_plain", tmp_path / name).get_parameter(bias) == step).all()


ABC = "ba7816bf8f01cfea414140de5dae2223b00361a396177a9cb410ff61f20015ad"
"""The SHA-256 of "abc", from FIPS 180."""


@pytest.mark.parametrize("name", ["init", "backbone"])
def test_a_run_does_not_resume_with_another_file_of_the_name_of_its_initial_weights(settings, tmp_path, name: str):
    (tmp_path / "moved").mkdir()
    file, moved, run = tmp_path / "start.safetensors", tmp_path / "moved" / "start.safetensors", tmp_path / "run"
    began = replace(settings, **{name: str(file)})
    claim_folder(run, began)
    for place, text in ((file, "damaged"), (file, "abc"), (moved, "abc")):
        place.write_text(text)
        record_weights(run, replace(settings, **{name: str(place)}))
        if text == "abc" and not (run / "checkpoints").exists():
            begin(run)
    assert json.loads((run / f"{name}.json").read_text()) == ABC
    file.write_text("abd")
    with pytest.raises(InputError) as told:
        record_weights(run, began)
    assert str(told.value).startswith(
        f"{file}: expected the file that {run} started from, with SHA-256 {ABC}, found one with a52d"
    )
    assert "\n" not in str(told.value)
    file.unlink()  # a run with a checkpoint does not need it
    record_weights(run, began)


def test_a_run_that_began_without_a_record_of_its_initial_weights_resumes(settings, tmp_path):
    file = tmp_path / "start.safetensors"
    file.write_text("abc")
    run, began = tmp_path / "run", replace(settings, init=str(file))
    claim_folder(run, began)
    begin(run)
    for text in ("abc", "abd"):
        file.write_text(text)
        record_weights(run, began)
    assert not (run / "init.json").exists()


def test_semgs_train_refuses_another_file_of_the_same_name_with_one_line(tmp_path, capsys):
    file, run = tmp_path / "start.safetensors", tmp_path / "run"
    file.write_text("abc")
    began = replace(PRESETS["small_plain"](), init=str(file))
    claim_folder(run, began)
    record_weights(run, began)
    begin(run)
    file.write_text("abd")
    assert main(["train", "small_plain", "--init", str(file), "--out", str(run)]) == 2
    told = capsys.readouterr().err.strip().splitlines()
    assert len(told) == 1
    assert "restore it, or train in a new folder" in told[0]


@pytest.mark.parametrize(
    "damage",
    [
        lambda _: {"channels": 48, "cnn_widths": [16, 32, 48]},
        lambda whole: whole | {"channels": 0},  # found by fuzzing: a division by zero
    ],
    ids=["flat settings", "no channels"],
)
@pytest.mark.filterwarnings("ignore:Initializing zero-element tensors")
def test_a_run_with_settings_that_make_no_network_is_refused_with_one_line(tmp_path: Path, damage):
    settings = TrainingSettings(model="small_plain", steps=1)
    (tmp_path / "checkpoints").mkdir()
    save_checkpoint(
        tmp_path / "checkpoints",
        TrainingState.begin(load("small_plain", "random"), make_supervision(settings), 1e-3, 0.9),
    )
    (tmp_path / NETWORK).write_text(json.dumps(damage(load("small_plain", "random").settings.as_json())))
    with pytest.raises(
        InputError, match="another version of semgs wrote it; resume with that version, or name a new folder"
    ) as told:
        empty_network(tmp_path, settings)
    assert len(str(told.value).splitlines()) == 1
