"""Progress as lines of JSON, for a program that starts a command."""

from __future__ import annotations

import json

import pytest

from semgs.cli.progress import VARIABLE, show_progress, show_stage


def test_stages_and_counts_are_lines_of_json_and_words_are_left_out(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setenv(VARIABLE, "json")
    with show_stage("Reading"), show_progress("Rooms", 2) as show:
        show(1)
        show(2, "1 failed")
    lines = [json.loads(line) for line in capsys.readouterr().err.splitlines()]
    counts = [{"stage": "Rooms", "done": done, "of": 2} for done in (0, 1, 2)]
    assert lines == [{"stage": "Reading"}, *counts]
