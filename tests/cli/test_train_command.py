"""`semgs train` as it is typed."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

import pytest

from semgs.cli.arguments import parse
from semgs.cli.errors import UsageError
from semgs.cli.main import main
from semgs.cli.train import Train
from semgs.training.loop import Outcome
from semgs.training.presets import small


def parsed(line: str) -> Train:
    return parse(Train, "train", line.split())


def test_a_preset_alone_is_the_preset():
    command = parsed("small --out run")
    assert command.settings == small()
    assert command.out == Path("run")
    assert command.minutes is None


def test_options_may_stand_before_and_behind_the_preset_and_override_it():
    command = parsed("--out run small --steps 70 --size 48x64 --losses.smoothness 0 --contexts 2 4 --minutes 3")
    assert (command.settings.steps, command.settings.size, command.settings.contexts) == (70, (48, 64), (2, 4))
    assert command.settings.losses.smoothness == 0
    assert command.settings.learning_rate == small().learning_rate
    assert command.minutes == 3


@pytest.mark.parametrize(
    ("line", "told"),
    [
        ("small", "--out"),
        ("small --out run --size 48,64", "expected height x width in pixels"),
        ("small --out run --contexts 1 2", r"contexts is \(1, 2\)"),
        ("small --out run --steps 0", "steps is 0; expected at least 1"),
        ("small --out run --stops 3", "--stops"),
        ("tiny --out run", "tiny"),
    ],
)
def test_what_cannot_be_is_told_on_one_line(line: str, told: str):
    with pytest.raises(UsageError, match=told) as caught:
        parsed(line)
    assert "\n" not in str(caught.value)


@pytest.mark.parametrize("line", ["--minutes 0", "--workers -1", "--save-minutes -2"])
def test_a_sitting_that_cannot_be_is_refused(line: str, tmp_path: Path):
    with pytest.raises(UsageError, match="must"):
        parsed(f"small --out {tmp_path / 'run'} {line}").run()
    assert not (tmp_path / "run").exists()


def test_a_run_of_other_settings_ends_with_exit_code_2_and_the_difference(tmp_path: Path, capsys, monkeypatch):
    line = ["train", "small", "--out", str(tmp_path / "run")]
    monkeypatch.setattr("semgs.training.loop.load", lambda *args, **options: pytest.skip("the run was accepted"))
    (tmp_path / "run").mkdir()
    from semgs.training.run import claim

    claim(tmp_path / "run", small())
    assert main([*line, "--steps", "77"]) == 2
    told = capsys.readouterr().err.strip().splitlines()
    assert told[-1].startswith("semgs: error: ")
    assert f"steps = {small().steps} there, 77 asked" in told[-1]


def test_what_differs_from_the_preset_is_told_and_how_it_ended(tmp_path: Path, capsys, monkeypatch):
    monkeypatch.setattr("semgs.training.loop.train", lambda *args, **options: Outcome(40, False, 1))
    monkeypatch.setattr("semgs.training.run.export_weights", lambda run, path: path)
    assert main(["train", "small", "--out", str(tmp_path), "--steps", "77"]) == 0
    told = capsys.readouterr().err
    assert f"steps: 77 (preset small: {small().steps})" in told
    assert "step 40 of 77, 1 skipped" in told
    assert "goes on from here" in told


def test_the_help_lists_the_settings_without_torch():
    lines = [
        "import sys",
        "from semgs.cli.main import main",
        "main(['train', 'small', '--help'])",
        "print('torch' in sys.modules)",
    ]
    told = subprocess.run([sys.executable, "-c", "\n".join(lines)], capture_output=True, text=True, check=True).stdout
    assert "--losses.smoothness" in told
    assert told.splitlines()[-1] == "False"
