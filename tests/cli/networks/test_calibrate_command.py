"""`semgs weights calibrate`."""

from __future__ import annotations

import json
from pathlib import Path

import pytest
import torch
from known_scenes import write_scene
from miniatures import miniature
from replicas import write_replica
from safetensors import safe_open
from safetensors.torch import save_file

from semgs.cli.main import main
from semgs.model.weights.header import SCENES
from semgs.model.weights.load import shipped
from semgs.model.weights.weights_file import read_temperatures, read_tensors, restate


@pytest.fixture(scope="module")
def scene(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return write_replica(tmp_path_factory.mktemp("replica") / "office_0/Sequence_1", miniature().first(4))


@pytest.mark.long
def test_temperatures_are_fitted_kept_beside_the_same_tensors_and_measured(
    scene: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
):
    out, plot = tmp_path / "fitted.safetensors", tmp_path / "plot.png"
    line = ["--data", str(scene), "--size", "48x64"]
    assert main(["weights", "calibrate", "small", *line, "--out", str(out), "--plot", str(plot)]) == 0
    fitted = capsys.readouterr().out
    temperatures = read_temperatures(out)
    assert temperatures is not None
    assert f"{temperatures.rendered:.3f}" in fitted
    assert plot.read_bytes().startswith(b"\x89PNG")
    before, after = read_tensors(shipped("small")), read_tensors(out)
    assert all((before[name] == after[name]).all() for name in before)
    assert main(["weights", "calibrate", str(out), *line]) == 0
    assert capsys.readouterr().out == fitted


@pytest.mark.parametrize("labelled", [0, 1])
def test_scenes_without_labels_where_they_are_needed_are_refused(
    labelled: int, tmp_path: Path, capsys: pytest.CaptureFixture[str]
):
    """Of three frames only the inner one is a target: with labels of the first alone no rendered pixel has one, with those of the inner one no input."""
    write_scene(tmp_path / "room", 3)
    content = json.loads((tmp_path / "room/transforms.json").read_text())
    for index, frame in enumerate(content["frames"]):
        if index != labelled:
            del frame["label_file_path"]
    (tmp_path / "room/transforms.json").write_text(json.dumps(content))
    for more in (["--out", str(tmp_path / "new")], []):
        assert main(["weights", "calibrate", "small", "--data", str(tmp_path / "room"), "--size", "36x48", *more]) == 2
        error = capsys.readouterr().err
        assert "expected labels in input views and target views, found only unlabelled ones" in error
        assert len(error.splitlines()) == 1
    assert not (tmp_path / "new").exists()


def test_bad_input_is_one_line(scene: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]):
    there = tmp_path / "there.safetensors"
    there.write_bytes(b"mine")
    colour, seen, new = tmp_path / "colour.safetensors", tmp_path / "seen.safetensors", tmp_path / "new"
    with safe_open(shipped("small"), "pt") as file:
        save_file({"a": torch.zeros(1)}, colour, {**file.metadata(), "classes": "null"})
    restate(shipped("small"), seen, {SCENES: json.dumps(["office_0_Sequence_2"])})
    on_scene = ["--data", str(scene)]
    lines = {
        "found colour-only weights": [str(colour), *on_scene, "--out", str(new)],
        "weights of semgs with classes, found another file": [str(there), *on_scene, "--out", str(new)],
        "found 1 that were": [str(seen), *on_scene, "--out", str(new)],
        "choose another name": ["small", *on_scene, "--out", str(there)],
        "2 or more, found '1'": ["small", *on_scene, "--views", "1", "--out", str(new)],
    }
    for told, line in lines.items():
        assert main(["weights", "calibrate", *line]) == 2
        error = capsys.readouterr().err
        assert told in error
        assert len(error.splitlines()) == 1
    assert there.read_bytes() == b"mine"
    assert not new.exists()
