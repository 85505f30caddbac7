"""`semgs recipe`: three short stages on small scenes."""

from __future__ import annotations

import json
from pathlib import Path

import pytest
from scenes_on_disk import write_labelled

from semgs.cli.main import main
from semgs.model.weights.initial_weights import initial_network
from semgs.model.weights.load import load
from semgs.model.weights.weights_file import save
from semgs.training.loop import Outcome
from semgs.training.run.execution import Execution
from semgs.training.training_settings import TrainingSettings


@pytest.fixture(scope="module")
def scans(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Sixteen scenes, as many as a step of the first stage needs, and one to validate on."""
    folder = tmp_path_factory.mktemp("recipe")
    for number in range(16):
        write_labelled(folder / "scans" / f"scene{number}", number, frames=8)
    write_labelled(folder / "held" / "scene", 99, frames=8)
    return folder


def recipe(scans: Path, out: Path, *more: str) -> int:
    given = (
        f"recipe small --data {scans / 'scans'} --validation {scans / 'held'} --size 32x48 --share 0.0001 --workers 0"
    )
    return main([*given.split(), "--out", str(out), *more])


def test_each_stage_starts_from_the_weights_of_the_one_before_and_is_not_run_twice(
    scans, tmp_path, monkeypatch, capsys
):
    """The trainings are stand-ins; real ones are in `make long`."""
    started = []

    def train(settings: TrainingSettings, out: Path, execution: Execution, **options: object) -> Outcome:
        started.append((settings.supervision, Path(settings.init).parent.name, out.name))
        save(out / "weights.safetensors", initial_network("small", "small"), {})
        return Outcome(settings.steps, True, 0)

    monkeypatch.setattr("semgs.training.loop.train", train)
    finished = "semgs.training.run.run_folder.is_finished"
    monkeypatch.setattr(finished, lambda run: (run / "weights.safetensors").exists())
    for _ in range(2):
        assert recipe(scans, tmp_path / "out") == 0
        assert started == [
            ("pictures", "", "1_classes"),
            ("depth", "1_classes", "2_depth"),
            ("rendered", "2_depth", "3_joint"),
        ]
        assert f"finished: {tmp_path / 'out/3_joint/weights.safetensors'}" in capsys.readouterr().out


@pytest.mark.long
def test_three_stages_run_one_after_the_other_and_are_not_run_twice(scans, tmp_path, capsys):
    assert recipe(scans, tmp_path / "out") == 0
    folders = [tmp_path / "out" / name for name in ("1_classes", "2_depth", "3_joint")]
    steps = [json.loads((folder / "log.jsonl").read_text().splitlines()[-1])["step"] for folder in folders]
    assert steps == [1, 1, 1]
    stages = [json.loads((folder / "settings.json").read_text()) for folder in folders]
    assert [stage["supervision"] for stage in stages] == ["pictures", "depth", "rendered"]
    assert load(folders[2] / "weights.safetensors").name == "small"
    assert f"finished: {folders[2] / 'weights.safetensors'}" in capsys.readouterr().out
    before = [(folder / "weights.safetensors").stat().st_mtime_ns for folder in folders]
    assert recipe(scans, tmp_path / "out") == 0
    assert [(folder / "weights.safetensors").stat().st_mtime_ns for folder in folders] == before


def test_a_stage_needs_the_one_before(scans, tmp_path, capsys):
    assert recipe(scans, tmp_path / "out", "--stage", "joint") == 2
    assert "--stage joint: stage depth in" in capsys.readouterr().err
    assert recipe(scans, tmp_path / "out", "--share", "0") == 2
    assert "share is 0.0; expected above 0" in capsys.readouterr().err
