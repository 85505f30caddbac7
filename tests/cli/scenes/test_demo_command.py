from __future__ import annotations

import json
from pathlib import Path

import pytest

from semgs.cli.main import main


@pytest.fixture
def small_demo(room: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """The demo with a small scene in place of the embedded one, and untrained weights in place of those that ship."""
    from semgs.model.weights import load as weights

    load = weights.load
    monkeypatch.setattr("semgs.data.demo_scene.demo_scene", lambda: room)
    monkeypatch.setattr(weights, "load", lambda name, _: load(name, "random"))
    return room


def test_the_demo_can_be_run_again_and_again(
    small_demo: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    for _ in range(2):
        assert main(["demo", "--out", str(tmp_path / "demo")]) == 0
        assert f"Open {tmp_path / 'demo' / 'report.html'} in a browser." in capsys.readouterr().out
    assert json.loads((tmp_path / "demo/report.json").read_text())["scene"]["name"] == small_demo.name


@pytest.mark.long
def test_the_demo_does_not_replace_another_scene(
    small_demo: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    assert main(["demo", "--out", str(tmp_path / "demo")]) == 0
    report = tmp_path / "demo/report.json"
    report.write_text(report.read_text().replace(f'"name": "{small_demo.name}"', '"name": "my own room"'))
    assert main(["demo", "--out", str(tmp_path / "demo")]) == 2
    assert "--overwrite" in capsys.readouterr().err
    assert main(["demo", "--out", str(tmp_path / "demo"), "--overwrite"]) == 0
