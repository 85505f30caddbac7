"""`semgs reconstruct --refine`."""

from __future__ import annotations

import json
from pathlib import Path

import pytest

import semgs
from semgs.cli.main import main


def test_refined_images_are_in_every_file_and_the_report_has_both(room: Path, tmp_path: Path) -> None:
    """Of frames 1 and 2, which are held out, 1 decides in one of two passes, and 2 is scored, before and after."""
    options = ["--weights", "random", "--context", "0", "3"]
    for name, more in (("plain", ["--refine", "0"]), ("refined", ["--refine", "2"])):
        assert main(["reconstruct", str(room), "--out", str(tmp_path / name), *options, *more]) == 0
    plain, refined = (json.loads((tmp_path / name / "report.json").read_text()) for name in ("plain", "refined"))
    assert plain["refinement"] is None
    assert refined["refinement"]["passes"] == 2
    assert refined["refinement"]["check"].endswith("001.png")
    assert len(refined["refinement"]["curve"]) == 2
    assert refined["refinement"]["before"]["context"] == plain["means"]["context"]
    assert refined["means"]["context"]["psnr"] > plain["means"]["context"]["psnr"]
    assert [view["position"] for view in refined["views"]] == [0, 3, 2]
    page = (tmp_path / "refined" / "report.html").read_text()
    assert "render, one pass" in page
    assert "held-out views, refined" in page
    assert ">Refinement<" in page
    one, other = (semgs.load_scene(tmp_path / name) for name in ("plain", "refined"))
    assert (one.gaussians.colour.features - other.gaussians.colour.features).abs().max() > 1e-3


@pytest.mark.parametrize(
    ("typed", "found"),
    [(["-2"], "found '-2'"), (["x"], "found 'x'"), (["2", "3"], "expected at most one value, found 2")],
)
def test_passes_that_are_no_number_are_refused(
    typed: list[str], found: str, room: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    assert main(["reconstruct", str(room), "--out", str(tmp_path / "out"), "--refine", *typed]) == 2
    assert found in capsys.readouterr().err
