"""`semgs reconstruct --exposure`."""

from __future__ import annotations

import json
from pathlib import Path

import pytest

from semgs.cli.main import main


@pytest.mark.long
def test_a_fitted_exposure_is_in_the_report_and_as_taken_is_not(room: Path, tmp_path: Path) -> None:
    notes = {}
    for choice in ("fitted", "as-taken"):
        out = tmp_path / choice
        options = ["--weights", "random", "--context", "0", "3", "--exposure", choice]
        assert main(["reconstruct", str(room), "--out", str(out), *options]) == 0
        notes[choice] = [note for note in json.loads((out / "report.json").read_text())["notes"] if "exposure" in note]
    assert len(notes["fitted"]) == 1
    assert notes["as-taken"] == []


def test_another_choice_is_refused_in_one_line(room: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["reconstruct", str(room), "--out", str(tmp_path / "out"), "--exposure", "bright"]) == 2
    told = capsys.readouterr().err
    assert told.count("\n") == 1
    assert "bright" in told
    assert "as-taken" in told
