"""`python -m paper.ablate` as it is typed. The trainings are stand-ins; a whole one with real ones is in `make long`."""

from __future__ import annotations

import json
import shutil
from dataclasses import asdict, replace
from pathlib import Path

import numpy as np
import pytest
import torch
from paper_commands import main

from paper.ablate.ablation_rows import SEMANTIC_ROWS
from semgs.files.contents import sha256
from semgs.files.images.pictures import write_png
from semgs.model.weights.initial_weights import initial_network
from semgs.model.weights.load import load
from semgs.model.weights.weights_file import save
from semgs.training.loop import Outcome
from semgs.training.presets import small_plain
from semgs.training.run.checkpoints import Checkpoint
from semgs.training.run.execution import Execution
from semgs.training.run.run_folder import claim_folder
from semgs.training.training_settings import TrainingSettings

LINE = "ablate small_plain --steps 2 --batch 1 --size 32x48 --contexts 2 2 --validation-scenes 0 --views 2 --workers 0"


@pytest.fixture
def labelled(scene: Path) -> Path:
    """A scene of four frames with labels of two classes."""
    file = json.loads((scene / "transforms.json").read_text())
    (scene / "labels").mkdir()
    for index, frame in enumerate(file["frames"]):
        write_png(scene / f"labels/{index:03d}.png", np.repeat([0, 1], 32).astype(np.uint8)[None].repeat(48, 0))
        frame["label_file_path"] = f"labels/{index:03d}.png"
    (scene / "transforms.json").write_text(json.dumps(file | {"label_set": "scannet20"}))
    return scene


@pytest.fixture
def trained(monkeypatch) -> list[tuple[str, TrainingSettings]]:
    """Replaces training by writing untrained weights of the row's network; what was trained is listed."""
    runs: list[tuple[str, TrainingSettings]] = []

    def train(settings, out, execution, **options):
        runs.append((out.parent.name, settings))
        model = initial_network(settings.model, "random", seed=settings.seed, switches=asdict(settings.network))
        save(out / "weights.safetensors", model, {})
        return Outcome(settings.steps, True, 0)

    monkeypatch.setattr("semgs.evaluation.scoring.intervals.RESAMPLES", 100)
    monkeypatch.setattr("semgs.evaluation.run.evaluation_page", lambda *given: "")
    monkeypatch.setattr("semgs.training.loop.train", train)
    monkeypatch.setattr("semgs.training.run.run_folder.is_finished", lambda run: (run / "weights.safetensors").exists())
    return runs


@pytest.mark.long
def test_five_rows_are_trained_evaluated_and_tabled_and_go_on_where_they_stopped(tmp_path, labelled, trained, capsys):
    line = [*LINE.split(), "--test", str(labelled), "--out", str(tmp_path / "out")]
    assert main(line) == 0
    told = capsys.readouterr().out
    assert [name for name, _ in trained] == ["none", "shared", "windows", "camera", "full"]
    assert [settings.network.shared_layers for _, settings in trained] == [False, True, True, True, True]
    assert [settings.network.windows for _, settings in trained] == [1, 1, 2, 2, 2]
    assert [settings.losses.smoothness > 0 for _, settings in trained] == [False, False, False, False, True]
    assert "Sm-Loss" in told
    assert "What each part adds" in told
    table = (tmp_path / "out/ablation.md").read_text()
    for name, _ in trained:
        report = tmp_path / f"out/seed_0/{name}/evaluation/report.json"
        miou = json.loads(report.read_text())["results"][0]["miou"]
        assert f"{miou:.3f} (" in table
    assert main(line) == 0
    assert len(trained) == 5  # nothing is trained or evaluated again
    assert (tmp_path / "out/ablation.md").read_text() == table


def test_evaluations_are_only_used_again_for_the_same_frames_weights_and_labels(tmp_path, labelled, trained, capsys):
    line = [*LINE.split(), "--rows", "none", "--out", str(tmp_path / "out"), "--test", str(labelled)]
    assert main(line) == 0
    folder = tmp_path / "out/seed_0/none/evaluation"
    first = (folder / "report.json").read_bytes()
    assert main(line) == 0
    assert (folder / "report.json").read_bytes() == first
    elsewhere = shutil.copytree(labelled, tmp_path / "elsewhere")
    for change in (["--test", str(elsewhere)], ["--views", "3"]):
        assert main([*line, *change]) == 2
        assert "choose another --out" in capsys.readouterr().err.splitlines()[-1]
    assert (folder / "report.json").read_bytes() == first
    weights = tmp_path / "out/seed_0/none/run/weights.safetensors"
    save(weights, load("small_plain", weights), {"description": "trained for longer"})
    assert main(line) == 0
    assert json.loads((folder / "report.json").read_text())["method"]["sha256"] == sha256(weights)
    assert (folder / "report.json").read_bytes() != first
    before = (folder / "report.json").read_bytes()
    assert main(line) == 0
    assert (folder / "report.json").read_bytes() == before
    for path in (labelled / "labels").iterdir():  # edited in place: one class instead of two
        write_png(path, np.zeros((48, 64), np.uint8))
    assert main(line) == 0
    result = json.loads((folder / "report.json").read_text())["results"][0]
    assert result["truth_sha256"] != json.loads(before)["results"][0]["truth_sha256"]


def test_the_base_of_variants_does_not_become_longer(tmp_path, labelled, trained, capsys):
    line = [
        *LINE.split(),
        "--stage",
        "semantic",
        "--data",
        str(labelled),
        "--out",
        str(tmp_path / "out"),
        "--rows",
        "base",
    ]
    assert main([*line, "--steps", "16"]) == 0
    assert main([*line, "--steps", "32"]) == 2
    assert "has 10 steps, not 20, and the variants start from it" in " ".join(capsys.readouterr().err.split())
    assert len(trained) == 2


def test_other_settings_and_scenes_without_labels_are_refused(tmp_path, room, labelled, trained, capsys):
    line = [*LINE.split(), "--out", str(tmp_path / "out")]
    assert main([*line, "--test", str(room)]) == 2
    assert "labelled scenes" in capsys.readouterr().err.splitlines()[-1]
    assert main([*line, "--test", str(labelled), "--learning-rate", "0.5"]) == 2
    assert "learning_rate = 0.001 there, 0.5 requested" in capsys.readouterr().err.splitlines()[-1]


def test_rooms_that_are_trained_in_are_refused_before_anything_is_trained(tmp_path, labelled, trained, capsys):
    for number in (0, 1):
        (tmp_path / f"data{number}").mkdir()
        (tmp_path / f"data{number}" / f"scene0007_0{number}").symlink_to(labelled)
    (tmp_path / "list.txt").write_text("scene0007_01\n")
    line = [
        *LINE.split(),
        "--data",
        str(tmp_path / "data0"),
        "--test",
        str(tmp_path / "data1"),
        "--out",
        str(tmp_path / "out"),
    ]
    assert main([*line, "--test-scenes", str(tmp_path / "list.txt"), "--protocol", "peers"]) == 2
    assert "found 1 that were: scene0007_01 (as scene0007_00)" in capsys.readouterr().err
    assert trained == []


@pytest.mark.parametrize(
    ("line", "told"),
    [
        ("--views 1", "--views: expected a whole number, 2 or more"),
        ("--seeds 1 1", "a seed twice"),
        ("--losses.smoothness 0", "the full method lacks Sm-Loss"),
        ("--network.windows 1", "the full method lacks Sw-Trans"),
        ("--minutes 0", "--minutes: expected more than 0"),
        ("--accumulate 2", "a step of 1 scenes cannot be shared by 1 processes in 2 pieces each"),
        ("--nodes 2", "--nodes"),
        ("--test nowhere", "nowhere"),
        ("--transfer nowhere", "nowhere"),
        ("--transfer . .", "--transfer needs folders of different names"),
        ("--stage semantic --full .", "--full is for --stage whole"),
        (
            "--stage semantic --supervision depth --augmentation.exposure 0.5",
            "expected 0 with supervision by rendered views",
        ),
        ("--full . --rows none shared", "--full gives the variant full, which --rows leaves out"),
        ("--rows half", "--rows half: --stage whole has none, shared, windows, camera, full"),
        ("--rows base", "--rows base: --stage whole has none"),
        (
            "--stage semantic --rows half",
            "--stage semantic has base, none, shared, windows, camera, full, smoothness_sum",
        ),
    ],
)
def test_what_cannot_be_is_one_line_and_nothing_is_written(tmp_path: Path, line: str, told: str, capsys):
    assert main([*LINE.split(), "--out", str(tmp_path / "out"), *line.split()]) == 2
    assert told in capsys.readouterr().err.strip().splitlines()[-1]
    assert not (tmp_path / "out").exists()


def test_a_dry_run_says_what_would_be_trained_and_writes_nothing(tmp_path: Path, monkeypatch, capsys):
    timed = []
    monkeypatch.setattr(
        "semgs.training.loop.train",
        lambda settings, out, execution: timed.append((settings.supervision, settings.steps)),
    )
    monkeypatch.setattr(
        "semgs.training.run.run_folder.newest_checkpoint",
        lambda folder: Checkpoint({}, {"step": 3, "seconds": 6.0}, ()),
    )
    line = [*LINE.split(), "--out", str(tmp_path / "out"), "--seeds", "3", "4", "--dry-run"]
    assert main(line) == 0
    assert "variant: 10 x 2 steps of 1 scenes at 32x48, about 2.00 s per step" in capsys.readouterr().out
    assert timed == [("rendered", 1), ("rendered", 3)]
    timed.clear()
    assert main([*line, "--stage", "semantic", "--steps", "80"]) == 0
    told = capsys.readouterr().out
    assert "base: depth: 1 x 50 steps" in told
    assert "base: colour: 1 x 10 steps" in told
    assert "variant: 14 x 80 steps" in told
    assert "then 14 evaluations with 2 views" in told
    assert [kind for kind, _ in timed] == ["depth", "depth", "rendered", "rendered", "labels", "labels"]
    assert not (tmp_path / "out").exists()


def test_the_semantic_rows_share_a_base_and_are_tested_on_other_worlds_too(
    tmp_path, labelled, trained, monkeypatch, capsys
):
    monkeypatch.setattr("paper.ablate.__main__.rows_of", lambda stage: SEMANTIC_ROWS[3:6:2])
    other, abroad = (shutil.copytree(labelled, tmp_path / name) for name in ("elsewhere", "abroad"))
    line = [*LINE.split(), "--stage", "semantic", "--data", str(labelled), "--out", str(tmp_path / "out")]
    line += ["--test", str(other), "--transfer", str(abroad)]
    assert main([*line, "--train-only"]) == 0
    assert list((tmp_path / "out").glob("seed_0/*/evaluation*")) == []
    assert main(line) == 0
    told = capsys.readouterr().out
    base = [(settings.supervision, settings.init) for _, settings in trained[:2]]
    assert base == [("depth", "random"), ("rendered", str(tmp_path / "out/base/depth/weights.safetensors"))]
    assert [name for name, _ in trained[2:]] == ["camera", "smoothness_sum"]
    assert {settings.init for _, settings in trained[2:]} == {str(tmp_path / "out/base/colour/weights.safetensors")}
    assert len(list((tmp_path / "out").glob("seed_0/*/evaluation/report.json"))) == 2
    assert len(list((tmp_path / "out").glob("seed_0/*/evaluation_abroad/report.json"))) == 2
    assert told.index("Evaluated on elsewhere") < told.index("Evaluated on abroad")
    assert "+ Sm-Loss, summed" in told
    assert "overlap" in told


def test_several_processes_train_variants_of_their_own_on_one_base(tmp_path, labelled, trained, capsys):
    line = [*LINE.split(), "--stage", "semantic", "--data", str(labelled), "--out", str(tmp_path / "out"), "--rows"]
    assert main([*line, "base"]) == 0
    assert len(trained) == 2
    assert capsys.readouterr().out == ""
    assert main([*line, "full", "none", "--seeds", "1", "2", "--train-only"]) == 0
    assert [(name, settings.seed) for name, settings in trained[2:]] == [
        ("none", 1), ("full", 1), ("none", 2), ("full", 2),
    ]  # fmt: skip
    assert main([*line, "shared", "--seeds", "1", "--train-only"]) == 0
    assert [name for name, _ in trained[6:]] == ["shared"]


@pytest.mark.long
@pytest.mark.timeout(1500)
def test_a_semantic_ablation_in_rooms(tmp_path: Path, capsys):
    """A miniature of the experiment: real trainings, real rooms, two tables."""
    line = [*LINE.split(), "--stage", "semantic", "--rooms", "3", "--steps", "8", "--out", str(tmp_path / "out")]
    test = tmp_path / "test"
    assert (
        main(["rooms", str(test), "--scenes", "2", "--frames", "4", "--size", "32x48", "--seed", "5", "--workers", "0"])
        == 0
    )
    assert main([*line, "--test", str(test)]) == 0
    told = capsys.readouterr().out
    assert told.count("Ablation, 2 input views, 4 targets") == 1
    assert len(list((tmp_path / "out").glob("seed_0/*/evaluation/report.json"))) == 7
    depth, colour = (
        load("small_plain", tmp_path / f"out/base/{stage}/weights.safetensors") for stage in ("depth", "colour")
    )
    row = load("small_plain", tmp_path / "out/seed_0/full/run/weights.safetensors").state_dict()
    kept = [name for name in row if not name.startswith("semantic.")]
    assert all(torch.equal(row[name], colour.state_dict()[name]) for name in kept)  # depth and colour stay
    assert any(not torch.equal(row[name], colour.state_dict()[name]) for name in row if name.startswith("semantic."))
    assert all(torch.equal(depth.state_dict()[name], row[name]) for name in depth.depth_parameters())
    assert main([*line, "--test", str(test)]) == 0  # nothing is left to do
    assert capsys.readouterr().out.count("step 8 of 8") == 0


@pytest.mark.long
@pytest.mark.timeout(1500)
def test_a_whole_ablation_in_rooms(tmp_path: Path, capsys):
    line = [*LINE.split(), "--views", "4", "--out", str(tmp_path)]
    assert main(line) == 0
    assert capsys.readouterr().out.count("–") > 5
    assert len(list(tmp_path.glob("seed_0/*/evaluation/report.json"))) == 5


@pytest.mark.long
def test_how_a_training_runs_is_passed_on(tmp_path, labelled, trained, monkeypatch, capsys):
    given = []

    def apart(run: Path, settings: TrainingSettings, execution: Execution):
        given.append((run.parent.name, execution))
        model = initial_network("small_plain", "random", switches=asdict(settings.network))
        save(run / "weights.safetensors", model, {})

    monkeypatch.setattr("paper.ablate.training_runs.train_apart", apart)
    line = [*LINE.split(), "--test", str(labelled), "--out", str(tmp_path / "out"), "--device", "cpu"]
    options = "--devices 2 --precision bf16 --accumulate 3 --save-minutes 7 --batch 6"
    assert main([*line, *options.split()]) == 0
    assert [name for name, _ in given] == ["none", "shared", "windows", "camera", "full"]
    assert given[0][1] == Execution("cpu", devices=2, precision="bf16", accumulate=3, workers=0, save_minutes=7.0)
    assert trained == []
    assert "Sm-Loss" in capsys.readouterr().out


@pytest.mark.long
def test_a_finished_run_of_the_full_method_is_evaluated_and_not_trained_again(tmp_path, labelled, trained, capsys):
    line = [*LINE.split(), "--test", str(labelled), "--out", str(tmp_path / "out"), "--full", str(tmp_path / "table1")]
    settings = replace(small_plain(), steps=2, batch=1, size=(32, 48), contexts=(2, 2), validation_scenes=0)
    claim_folder(tmp_path / "table1", settings)
    assert main(line) == 2
    assert "is not finished" in capsys.readouterr().err
    save(tmp_path / "table1" / "weights.safetensors", initial_network("small_plain", "random"), {})
    assert main([*line, "--steps", "3"]) == 2
    assert "has other settings: steps = 2 there, 3 here" in " ".join(capsys.readouterr().err.split())
    assert main(line) == 0
    assert [name for name, _ in trained] == ["none", "shared", "windows", "camera"]
    assert (tmp_path / "out/seed_0/full/evaluation/report.json").exists()
