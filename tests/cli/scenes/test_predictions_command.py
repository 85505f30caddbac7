"""A file of predicted cameras and depth in `semgs reconstruct` and `semgs doctor`."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import predicted_files as files
import pytest
from predicted_files import Made, save

from semgs.cli.main import main

MADE = Made((100, 140), (364, 518), (3.7, 3.64), count=4)


def write(folder: Path) -> Path:
    MADE.write_photos(folder / "images")
    return save(folder / "predictions.npz", files.vggt(MADE))


def test_photos_without_poses_become_labelled_gaussians(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    predictions = write(tmp_path / "kitchen")
    arguments = ["reconstruct", str(predictions), "--out", str(tmp_path / "out"), "--weights", "random"]
    assert main([*arguments, "--size", "48x64", "--depth", "sensor"]) == 0
    assert "note      Cameras and depth were predicted by VGGT; no sensor measured them." in capsys.readouterr().out
    report = json.loads((tmp_path / "out/report.json").read_text())
    assert (report["scene"]["name"], report["scene"]["layout"]) == ("kitchen", "VGGT predictions")
    assert (tmp_path / "out/semantics.ply").exists()


@pytest.mark.long
def test_the_doctor_tests_predicted_cameras(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    predictions = write(tmp_path)
    assert main(["doctor", str(predictions)]) == 0
    assert "The cameras fit: depth maps disagree by 0." in capsys.readouterr().out
    fields = files.vggt(MADE)
    fields["extrinsic"][:, :3, 3] *= -1  # a mistake that the reader does not know
    save(predictions, fields)
    assert main(["doctor", str(predictions)]) == 3


def test_a_file_of_something_else_ends_with_one_line_and_code_2(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    path = save(tmp_path / "weights.npz", {"kernel": np.ones((3, 3))})
    assert main(["reconstruct", str(path), "--out", str(tmp_path / "out")]) == 2
    said = capsys.readouterr().err
    assert said.count("\n") == 1
    assert said.endswith("depthmaps (DUSt3R), found kernel\n")
