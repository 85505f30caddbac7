"""Plots without matplotlib, which is an extra: refused before work, with what to install; pages leave them out."""

from __future__ import annotations

import io
from collections.abc import Callable
from importlib.util import find_spec
from pathlib import Path

import numpy as np
import pytest
from paper_commands import main
from PIL import Image

from paper.ablate.validation_plot import validation_picture
from paper.figure.comparison import FigureBlock, PictureRow, comparison
from semgs.figures import plotting
from semgs.figures.class_images import LegendEntry
from semgs.figures.plotting import ReliabilityPlot, RiskCurve, reliability_png, risk_coverage_picture


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


def opened(content: bytes) -> np.ndarray:
    return np.asarray(Image.open(io.BytesIO(content)).convert("RGB"))


def block_named(title: str, heading: str, label: str) -> np.ndarray:
    row = PictureRow(label, (np.full((60, 80, 3), 255, np.uint8),))
    return opened(comparison([FigureBlock(title, (heading,), (row,))])["png"])


NAMED: dict[str, Callable[[str], np.ndarray]] = {
    "title": lambda name: block_named(name, "h", "r"),
    "heading": lambda name: block_named("", name, "r"),
    "label": lambda name: block_named("", "h", name),
    "legend": lambda name: opened(
        comparison(
            [FigureBlock("", ("h",), (PictureRow("r", (np.full((60, 80, 3), 255, np.uint8),)),))],
            [LegendEntry(name, (255, 255, 255), 1.0)],
        )["png"]
    ),
    "reliability": lambda name: opened(reliability_png([ReliabilityPlot(name, ((name, ((1.0, 0.5, 0.5),)),))])),
    "risk": lambda name: risk_coverage_picture([RiskCurve(name, (0.5, 1.0), (0.1, 0.2), (None, None), (None, None))]),
    "validation": lambda name: validation_picture({name: [{1: 0.1, 2: 0.2}]}, "mIoU"),
}
"""Figures by where they show a name."""


@pytest.mark.parametrize("place", NAMED)
def test_dollars_in_a_name_begin_no_formula(place: str) -> None:
    """As a formula, it would be an error: there is no such letter."""
    NAMED[place]("$\\foo$")


@pytest.mark.parametrize("place", ["title", "heading", "legend"])
def test_dollars_in_a_name_are_shown(place: str) -> None:
    """As a formula, $l$ would be one letter, and hardly darker than l."""
    plain, with_dollars = (int((NAMED[place](name) < 128).sum()) for name in ("l", "$l$"))
    assert with_dollars > plain + 20
