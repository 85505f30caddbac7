"""Whole runs: the real network, rooms and splatting, and the command itself."""

from __future__ import annotations

import io
import json
import signal
import subprocess
import sys
import time
from contextlib import suppress
from dataclasses import replace
from pathlib import Path

import pytest
import torch
from rich.console import Console
from scenes_on_disk import write_labelled, write_table
from training_data import run_data, run_portions, run_validation

from semgs.data.origin.terms import ROOMS
from semgs.data.tables.class_files import read_class_file
from semgs.data.tables.classes import SCANNET20
from semgs.data.views import Batch
from semgs.files.errors import InputError
from semgs.model.networks import named_switches
from semgs.model.weights.load import data_terms, load
from semgs.model.weights.weights_file import read_header, save
from semgs.objectives.loss_weights import LossWeights
from semgs.training.data.batches import validation_batches
from semgs.training.data.data_settings import VALIDATION_SEED, Augmentation
from semgs.training.loop import train
from semgs.training.run.checkpoints import newest_checkpoint
from semgs.training.run.execution import Execution
from semgs.training.run.run_folder import record_assets
from semgs.training.training_settings import TrainingSettings
from semgs_rooms.sets.room_stream import RoomSamples, sample

SETTINGS = TrainingSettings(
    model="small_plain",
    steps=2,
    batch=1,
    size=(32, 48),
    contexts=(2, 2),
    targets=1,
    context_targets=True,
    losses=LossWeights(),
    depth_weight=0.1,
    seed=4,
    validate_every=2,
    validation_scenes=1,
)


def batches_of(settings: TrainingSettings, folder: Path, start: int = 0) -> list[Batch]:
    """The batches that a run sees from a step on; `folder` is its own."""
    folder.mkdir(exist_ok=True)
    portions = run_portions(settings, folder, start)
    return [batch for portion in portions for batch in portion.pieces]


def validated(settings: TrainingSettings, folder: Path) -> list[Batch]:
    """The batches that a run is validated on."""
    return run_validation(settings, folder)


@pytest.mark.usefixtures("real_rendering")
def test_two_real_steps_leave_weights_that_load_and_the_same_bits_in_one_session_or_two(
    tmp_path: Path, checkpoint_reads: list[int]
):
    pytest.importorskip("embreex")
    outcome = train(SETTINGS, tmp_path / "run", Execution(workers=0))
    assert (outcome.step, outcome.finished, outcome.skipped) == (2, True, 0)
    path = tmp_path / "run" / "weights.safetensors"
    model = load("small_plain", path)
    # The one validation is the best so far.
    best = load("small_plain", tmp_path / "run" / "best.safetensors")
    assert all(torch.equal(a, b) for a, b in zip(model.parameters(), best.parameters(), strict=True))
    start = load("small_plain", "random", seed=SETTINGS.seed)
    assert any((a != b).any() for a, b in zip(model.parameters(), start.parameters(), strict=True))
    metadata = read_header(path).metadata
    assert (metadata["seed"], metadata["step"]) == ("4", "2")
    assert metadata["description"] == "small_plain, 2 of 2 steps of a training in generated rooms"
    assert data_terms(path) == (ROOMS,)
    assert path.stat().st_size < 12e6
    # The same run in two sessions, with the real network, rooms and splatting, ends with the same bits.
    for step in (1, 2):
        checkpoint_reads.clear()
        assert train(SETTINGS, tmp_path / "cut", Execution(workers=0, minutes=0.0)).step == step
    # To resume, twice to delete old ones (when the best is saved, and at the end), and for the weights.
    assert checkpoint_reads == [1, 1, 1, 2]
    whole, parts = (newest_checkpoint(tmp_path / name / "checkpoints").tensors for name in ("run", "cut"))
    assert all(torch.equal(whole[name], parts[name]) for name in whole)


@pytest.fixture(scope="module")
def with_shared_cnn(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Weights whose branches share the shallow CNN, as those that ship do not."""
    path = tmp_path_factory.mktemp("weights") / "shared.safetensors"
    save(path, load("small_plain", "random"), {"description": "drawn"})
    return path


@pytest.mark.long
@pytest.mark.parametrize(
    ("supervision", "held"),
    [pytest.param("labels", False, marks=pytest.mark.long), ("labels", True), ("pictures", True)],
)
def test_supervision_by_labels_renders_nothing_and_moves_the_semantic_branch_alone(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, with_shared_cnn: Path, supervision: str, held: bool
):
    monkeypatch.setattr("semgs.scene.encoding.render", None)
    own = write_labelled(tmp_path / "own", 1, labels=(0, 4, 5))
    settings = replace(
        SETTINGS, supervision=supervision, init=str(with_shared_cnn), data=(str(own),), validation=str(own), depth_weight=0.0,
        shared_rate=0.0 if held else 1.0,
    )  # fmt: skip
    train(settings, tmp_path / "run", Execution(workers=0))
    model, start = load("small_plain", tmp_path / "run" / "weights.safetensors"), load("small_plain", with_shared_cnn)
    moved = {
        name
        for (name, value), old in zip(model.named_parameters(), start.parameters(), strict=True)
        if (value != old).any()
    }
    assert moved
    assert moved <= model.semantic_parameters()
    assert any(name.startswith("cnn.") for name in moved) == (not held)
    assert any(name.startswith("semantic.transformer.") for name in moved) == (supervision == "labels")
    lines = [json.loads(line) for line in (tmp_path / "run" / "log.jsonl").read_text().splitlines()]
    steps = [line for line in lines if "total" in line]
    assert all(line["psnr"] is None and line["total"] == line["semantic"] > 0 for line in steps)
    checks = [line["validation"] for line in lines if "validation" in line]
    assert len(checks) == 2
    assert all(check["psnr"] is None and 0 <= check["miou"] <= 1 for check in checks)
    assert (tmp_path / "run" / "validation" / "00000002.png").is_file()


@pytest.mark.long
@pytest.mark.parametrize("held", [pytest.param(False, marks=pytest.mark.long), True])
def test_supervision_by_depth_renders_nothing_and_ends_with_the_same_bits_in_one_session_or_two(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, with_shared_cnn: Path, held: bool
):
    monkeypatch.setattr("semgs.scene.encoding.render", None)
    own = write_labelled(tmp_path / "own", 1)
    settings = replace(
        SETTINGS, supervision="depth", init=str(with_shared_cnn), data=(str(own),), validation=str(own),
        shared_rate=0.0 if held else 1.0,
    )  # fmt: skip
    train(settings, tmp_path / "run", Execution(workers=0))
    model, start = load("small_plain", tmp_path / "run" / "weights.safetensors"), load("small_plain", with_shared_cnn)
    moved = {
        name
        for (name, value), old in zip(model.named_parameters(), start.parameters(), strict=True)
        if (value != old).any()
    }
    assert moved
    assert moved <= model.depth_parameters()
    assert any(name.startswith("cnn.") for name in moved) == (not held)
    lines = [json.loads(line) for line in (tmp_path / "run" / "log.jsonl").read_text().splitlines()]
    steps = [line for line in lines if "total" in line]
    assert all(line["psnr"] is None and line["depth"] > 0 and line["distribution"] > 0 for line in steps)
    checks = [line["validation"] for line in lines if "validation" in line]
    assert len(checks) == 2
    assert all(check["depth_abs_rel"] > 0 and 0 <= check["depth_delta_125"] <= 1 for check in checks)
    assert (tmp_path / "run" / "best.safetensors").is_file()
    assert (tmp_path / "run" / "validation" / "00000002.png").is_file()
    cut = [train(settings, tmp_path / "cut", Execution(workers=0, minutes=0.0)).step for _ in range(2)]
    assert cut == [1, 2]
    whole, parts = (newest_checkpoint(tmp_path / name / "checkpoints").tensors for name in ("run", "cut"))
    assert all(torch.equal(whole[name], parts[name]) for name in whole)


def test_depth_is_learned_in_rooms_drawn_live(tmp_path: Path):
    pytest.importorskip("embreex")
    train(replace(SETTINGS, supervision="depth", steps=1), tmp_path / "run", Execution(workers=0))
    lines = [json.loads(line) for line in (tmp_path / "run" / "log.jsonl").read_text().splitlines()]
    assert [line["validation"]["depth_abs_rel"] > 0 for line in lines if "validation" in line] == [True]


@pytest.mark.long
@pytest.mark.usefixtures("real_rendering")
def test_a_training_on_own_classes_begins_with_weights_and_leaves_some_that_know_them(tmp_path: Path):
    table = read_class_file(write_table(tmp_path / "three.json"))
    own = write_labelled(
        tmp_path / "own", 1, labels=(0, 4, 5), change=lambda one: one.update(label_set="../three.json")
    )
    settings = replace(
        SETTINGS, model="small", network=named_switches("small"), init="small", classes=table.table, data=(str(own),), validation=str(own), steps=1, learning_rate=1e-6,
        class_weights="inverse_root_frequency", augmentation=Augmentation(flip=True),
    )  # fmt: skip
    console = Console(file=io.StringIO(), width=300)
    train(settings, tmp_path / "run", Execution(workers=0), console=console)
    told = console.file.getvalue()
    assert "tensors kept; drawn anew for the 3 classes of three" in told
    assert "classes: three (wall, seat, floor)" not in told, "there is no preset to differ from"
    header = read_header(tmp_path / "run" / "weights.safetensors")
    assert header.classes == table.table
    assert header.metadata["data"] == own.name  # not where it lay
    model, start = (load("small", path, classes=table.table if path else SCANNET20) for path in (
        tmp_path / "run" / "weights.safetensors", None
    ))  # fmt: skip
    for name, value in start.state_dict().items():
        if name not in start.parts()["classes"]:
            torch.testing.assert_close(model.state_dict()[name], value, rtol=0.02, atol=1e-4)
    checks = [json.loads(line) for line in (tmp_path / "run" / "log.jsonl").read_text().splitlines()]
    assert [line["step"] for line in checks if "validation" in line] == [0, 1]


@pytest.mark.long
def test_step_k_sees_the_same_batch_wherever_the_run_began(tmp_path: Path):
    pytest.importorskip("embreex")
    settings = TrainingSettings(model="small_plain", steps=4, batch=2, size=(16, 24), contexts=(2, 4), targets=2)
    whole, rest = batches_of(settings, tmp_path), batches_of(settings, tmp_path, start=2)
    assert [batch.scenes for batch in whole[2:]] == [batch.scenes for batch in rest]
    for a, b in zip(whole[2:], rest, strict=True):
        assert torch.equal(a.context.images, b.context.images)
        assert torch.equal(a.target.labels, b.target.labels)
        assert len(a.context) in (2, 3, 4)


def test_validation_rooms_do_not_depend_on_the_seed_of_the_run(tmp_path: Path):
    pytest.importorskip("embreex")
    options = {"model": "small_plain", "steps": 1, "size": (16, 24), "contexts": (2, 2), "validation_scenes": 1}
    (one,) = validated(TrainingSettings(seed=1, **options), tmp_path)
    (two,) = validated(TrainingSettings(seed=2, **options), tmp_path)
    assert torch.equal(one.target.images, two.target.images)


def test_a_training_sees_homes(tmp_path: Path):
    pytest.importorskip("embreex")
    options = {"model": "small_plain", "steps": 1, "batch": 1, "size": (16, 24), "contexts": (2, 2)}
    (batch,) = batches_of(TrainingSettings(**options), tmp_path)
    home, other = (sample(0, 0, size=(16, 24), contexts=2, targets=2, style=style)[0] for style in ("home", "other"))
    assert torch.equal(batch.context.images[0], home.images)
    assert not torch.equal(batch.context.images[0], other.images)


def processes_that_hold(path: Path) -> list[str]:
    """Command lines of the processes that have a file open, after a moment of grace (Linux; none elsewhere)."""
    time.sleep(10)
    found = []
    for process in Path("/proc").glob("[0-9]*"):
        try:
            if any(file.readlink() == path for file in (process / "fd").iterdir()):
                found.append((process / "cmdline").read_text())
        except OSError:
            continue
    return found


@pytest.mark.long
@pytest.mark.timeout(1800)
def test_the_command_killed_at_random_moments_and_given_again_ends_with_the_same_bits(tmp_path: Path):
    scans = write_labelled(tmp_path / "scans" / "one", 1).parent

    def command(out: Path) -> list[str]:
        options = (
            "--steps 40 --batch 1 --size 32x48 --contexts 2 3 --targets 1 --validate-every 16 --validation-scenes 1 "
            f"--augmentation.flip --data rooms=2 {scans}=1"
        )
        return [
            sys.executable, "-c", "import sys; from semgs.cli.main import main; sys.exit(main())",
            "train", "small_plain", "--out", str(out), "--save-minutes", "0.02", *options.split(),
        ]  # fmt: skip

    def is_finished(out: Path) -> dict[str, torch.Tensor]:
        subprocess.run(command(out), check=True, capture_output=True, timeout=900, start_new_session=True)
        return newest_checkpoint(out / "checkpoints").tensors

    generator = torch.Generator().manual_seed(0)
    began = time.monotonic()
    whole = is_finished(tmp_path / "whole")
    length = time.monotonic() - began
    told = (tmp_path / "cut.txt").open("w")
    for kind in [signal.SIGKILL] * 16 + [signal.SIGTERM] * 4:
        run = subprocess.Popen(command(tmp_path / "cut"), stdout=told, stderr=told, start_new_session=True)
        with suppress(subprocess.TimeoutExpired):  # a run that has nothing left to do ends before
            run.wait(timeout=length * float(torch.rand(1, generator=generator)))
        run.send_signal(kind)
        run.wait(timeout=120)
    told.close()
    parts = is_finished(tmp_path / "cut")
    assert whole.keys() == parts.keys()
    assert all(torch.equal(whole[name], parts[name]) for name in whole)
    assert processes_that_hold(tmp_path / "cut.txt") == []


@pytest.mark.long
def test_scenes_that_serve_several_samples_are_kept_in_the_folder_of_the_run(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
):
    pytest.importorskip("embreex")
    settings = TrainingSettings(
        model="small_plain", steps=3, batch=2, size=(16, 24), contexts=(2, 3), targets=1, scene_reuse=2
    )
    monkeypatch.setattr("semgs_rooms.sets.pool.FRAMES", 5)
    monkeypatch.setattr("semgs_rooms.sets.pool.WINDOW", 3)
    whole = batches_of(settings, tmp_path / "one")
    (last,) = batches_of(settings, tmp_path / "two", start=2)
    assert torch.equal(whole[2].context.images, last.context.images)
    assert torch.equal(whole[2].target.labels, last.target.labels)
    assert {path.name[:6] for path in (tmp_path / "one" / "rooms").iterdir()} == {"scene_"}


def test_training_and_validation_rooms_take_different_assets(tmp_path, monkeypatch):
    for name in ("catalog.json", "textures.json"):
        (tmp_path / name).write_text("[]")
    splits = {}

    class Watched(RoomSamples):
        def __init__(self, seed, size, contexts, targets, length, group=1, library=None):
            splits[seed] = library and library.split
            super().__init__(seed, size, contexts, targets, length, group, library)

    monkeypatch.setattr("semgs_rooms.training_rooms.RoomSamples", Watched)
    settings = TrainingSettings(
        model="small_plain", steps=1, size=(16, 24), contexts=(2, 2), validation_scenes=1, assets=(str(tmp_path),)
    )
    data = run_data(settings, tmp_path)
    run_portions(settings, Path("unused"), data=data)
    validation_batches(settings, data.classes)
    assert splits == {settings.seed: "training", VALIDATION_SEED: "validation"}


def test_assets_that_are_not_there_end_a_training_before_it_makes_its_folder(tmp_path):
    settings = TrainingSettings(model="small_plain", steps=1, assets=(str(tmp_path / "none"),))
    with pytest.raises(InputError, match="no such folder"):
        train(settings, tmp_path / "run")
    assert not (tmp_path / "run").exists()


def test_a_run_goes_on_with_the_assets_that_it_began_with(tmp_path):
    run = tmp_path / "run"
    run.mkdir()
    (tmp_path / "assets").mkdir()
    (tmp_path / "assets" / "lock.json").write_text("one")
    record_assets(run, [str(tmp_path / "assets")])
    record_assets(run, [str(tmp_path / "assets")])
    (tmp_path / "assets" / "lock.json").write_text("grown")
    with pytest.raises(InputError, match="those that the run started with"):
        record_assets(run, [str(tmp_path / "assets")])
