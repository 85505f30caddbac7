"""Several trainings by one command: what is finished, and what more steps change."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace

import pytest

from paper.ablate.train_apart import main, train_apart
from paper.ablate.training_runs import train_or_resume
from semgs.objectives.loss_weights import LossWeights
from semgs.training.loop import Outcome
from semgs.training.presets import small_plain
from semgs.training.run.checkpoints import Checkpoint
from semgs.training.run.execution import Execution
from semgs.training.run.run_folder import claim_folder, read_settings


@pytest.fixture
def trained(monkeypatch) -> list[int]:
    """Replaces training; lists the steps of each."""
    found: list[int] = []

    def train(settings, out: Path, execution, **options):
        found.append(settings.steps)
        (out / "weights.safetensors").touch()
        return Outcome(settings.steps, True, 0)

    monkeypatch.setattr("semgs.training.loop.train", train)
    monkeypatch.setattr(
        "semgs.training.run.run_folder.newest_checkpoint",
        lambda folder: Checkpoint({}, {"step": max(found)}, ()) if found else None,
    )
    return found


def test_a_finished_training_goes_on_if_more_steps_are_requested_and_only_then(tmp_path: Path, trained):
    for steps, ran in ((2, [2]), (2, [2]), (3, [2, 3]), (3, [2, 3])):
        assert train_or_resume("a run", tmp_path / "run", replace(small_plain(), steps=steps), Execution())
        assert trained == ran
        assert read_settings(tmp_path / "run").steps == steps


def test_a_program_of_its_own_trains_the_requested_steps(tmp_path: Path, trained, monkeypatch):
    began: list[int] = []
    monkeypatch.setattr(
        "paper.ablate.training_runs.train_apart",
        lambda run, settings, execution: began.append(settings.steps),
    )
    for steps in (2, 3):
        train_or_resume("a run", tmp_path / "run", replace(small_plain(), steps=steps), Execution(devices=2))
    assert began == [2, 3]


def test_a_program_of_its_own_takes_over_a_run_that_learned_nothing(tmp_path: Path, monkeypatch):
    """It must not train the settings that an earlier, mistyped command left there."""
    settings = replace(small_plain(), steps=2, losses=LossWeights(smoothness=0.25), class_weights=(2.0,) * 20)
    claim_folder(tmp_path / "run", replace(settings, init="nope.pt", steps=9))
    given: list[str] = []
    monkeypatch.setattr("subprocess.run", lambda line, check: given.extend(line[3:]) or SimpleNamespace(returncode=0))
    train_apart(tmp_path / "run", settings, Execution(devices=2, minutes=3.0))
    began: list[object] = []
    monkeypatch.setattr("semgs.training.loop.train", lambda *arguments, **options: began.extend(arguments))
    assert main(given) == 0
    assert began == [settings, tmp_path / "run", Execution(devices=2, minutes=3.0)]
