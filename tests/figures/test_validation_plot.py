"""Scores during training, as a picture."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from paper.ablate.validation_plot import validation_picture
from semgs.training.run.log import read_validations


def test_a_line_for_each_kind_through_the_means_of_its_runs(monkeypatch: pytest.MonkeyPatch):
    drawn, plain = [], np.zeros((2, 2, 3), np.uint8)
    monkeypatch.setattr("paper.ablate.validation_plot.render_figure", lambda figure: drawn.append(figure) or plain)
    runs = {"none": [{0: 0.1, 50: 0.3, 100: 0.5}, {0: 0.1, 50: 0.5}], "full": [{0: 0.2, 50: 0.6}], "empty": []}
    assert validation_picture(runs, "mIoU") is plain
    (axes,) = drawn[0].axes
    assert [line.get_label() for line in axes.lines] == ["none", "full"]
    assert axes.lines[0].get_xdata().tolist() == [0, 50]  # steps that both runs have
    assert axes.lines[0].get_ydata().tolist() == pytest.approx([0.1, 0.4])
    assert axes.get_ylabel() == "mIoU"


def test_validations_are_read_from_the_log_of_a_run(tmp_path: Path):
    assert read_validations(tmp_path, "miou") == {}
    (tmp_path / "log.jsonl").write_text(
        '{"step": 0, "validation": {"miou": 0.02, "psnr": 9.0}}\n{"step": 20, "total": 1.5}\n'
        '{"step": 40, "validation": {"miou": null}}\nnonsense\n{"step": 60, "validation": {"miou": 0.25}}\n{"step": 80, "val'
    )
    assert read_validations(tmp_path, "miou") == {0: 0.02, 60: 0.25}
