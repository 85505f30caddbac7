"""Plots without matplotlib, which is an extra: refused before work, with what to install; pages leave them out."""

from __future__ import annotations

from importlib.util import find_spec
from pathlib import Path

import pytest

from semgs.cli.main import main
from semgs.figures import plotting


@pytest.fixture
def without_matplotlib(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(plotting, "find_spec", lambda name: None if name == "matplotlib" else find_spec(name))


@pytest.mark.usefixtures("without_matplotlib")
def test_commands_that_plot_say_what_to_install(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    data = tmp_path / "scans"
    data.mkdir()
    line = "semgs: error: plots need matplotlib: pip install -e '.[figures]' in SemGS's folder\n"
    for arguments in (
        ["figure", "qualitative", "--weights", "small", "--data", str(data), "--out", str(tmp_path / "out")],
        ["weights", "calibrate", "small", "--data", str(data), "--plot", str(tmp_path / "plot.png")],
    ):
        assert main(arguments) == 2
        assert capsys.readouterr().err == line


def test_a_figure_has_the_pixels_of_its_size() -> None:
    figure = plotting.new_figure((3.0, 2.0), dpi=50)
    assert plotting.render_figure(figure).shape == (100, 150, 3)
