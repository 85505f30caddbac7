"""`semgs evaluate --segmenter`: whose classes count, and what a file says that they mean."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest
from correspondences import write_correspondence
from PIL import Image
from scenes_on_disk import write_labelled

from semgs.cli.main import main
from semgs.data.scenes import open_scene
from semgs.data.tables.classes import IGNORE, SCANNET20


@pytest.fixture
def room(tmp_path: Path) -> Path:
    """Six labelled frames: wall, floor and chair."""
    return write_labelled(tmp_path / "room", 8)


@pytest.fixture
def renamed(room: Path, tmp_path: Path) -> Path:
    """True labels of the room under names that mean nothing, reversed: number k stands for ScanNet's class 19 - k."""
    folder = tmp_path / "maps"
    for frame in open_scene(room).frames:
        labels = frame.view((0.1, 10.0), open_scene(room).classes).labels[0].numpy()
        path = folder / Path(frame.name).with_suffix(".png")
        path.parent.mkdir(parents=True, exist_ok=True)
        Image.fromarray(np.where(labels == IGNORE, IGNORE, 19 - labels).astype(np.uint8)).save(path)
    listed = [{"name": f"thing {number}", "colour": [number, 0, 0]} for number in range(20)]
    (folder / "classes.json").write_text(json.dumps({"name": "things", "classes": listed}))
    return folder


@pytest.mark.long
def test_a_correspondence_makes_a_segmenter_of_unknown_names_useful(
    room: Path, renamed: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
):
    """The evaluation is refused by names; with the file, accuracy of what is seen is that of true labels, fused and rendered."""
    evaluate = [
        "evaluate",
        "small",
        "--data",
        str(room),
        "--views",
        "2",
        "--size",
        "32x48",
        "--segmenter",
        str(renamed),
    ]
    assert main([*evaluate, "--out", str(tmp_path / "first")]) == 2
    assert "answers in the classes of the labels, scannet20, found things" in capsys.readouterr().err
    votes = {"theirs": [1.0] * 20, "own": [0.2] * 20, "bias": [0.0] * 20}
    names = [f"thing {number}" for number in range(20)]
    meaning = write_correspondence(tmp_path / "meaning.json", names, np.eye(20)[::-1], votes=votes)
    stated = ["--correspondence", str(meaning), "--with-own-classes"]
    assert main([*evaluate, *stated, "--out", str(tmp_path / "second")]) == 0
    numbers = json.loads((tmp_path / "second/report.json").read_text())
    assert f"The classes are from {renamed}, and the model; fused over the input views." in numbers["notes"]
    assert "small + segmenter" in capsys.readouterr().out


def test_the_maps_of_every_scene_must_be_in_the_classes_of_the_labels(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
):
    """The maps of the second scene list ScanNet's classes backwards: their number 0 is the labels' number 19."""
    for name, names in (("attic", SCANNET20.names), ("hall", SCANNET20.names[::-1])):
        write_labelled(tmp_path / "rooms" / name, 8, frames=3)
        listed = [{"name": one, "colour": [0, 0, 0]} for one in names]
        (tmp_path / "maps" / name).mkdir(parents=True)
        (tmp_path / "maps" / name / "classes.json").write_text(json.dumps({"name": "backwards", "classes": listed}))
    evaluate = ["evaluate", "small", "--data", str(tmp_path / "rooms"), "--views", "2", "--size", "32x48"]
    assert main([*evaluate, "--segmenter", str(tmp_path / "maps"), "--out", str(tmp_path / "out")]) == 2
    assert "answers in the classes of the labels, scannet20, found backwards" in capsys.readouterr().err


@pytest.mark.parametrize("others", [["--workers", "1"], []])
def test_a_segmenter_does_not_go_with_workers_or_predictions(
    room: Path, renamed: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str], others: list[str]
):
    method = ["small"] if others else ["--predictions", str(renamed)]
    command = ["evaluate", *method, "--data", str(room), "--segmenter", str(renamed), "--out", str(tmp_path / "out")]
    assert main([*command, *others]) == 2
    assert "--segmenter cannot go with --" in capsys.readouterr().err


def test_a_second_look_of_a_network_whose_classes_nobody_uses_is_refused(
    room: Path, renamed: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
):
    data, out, looks = ["--data", str(room)], ["--out", str(tmp_path / "out")], ["--looks", "2"]
    segmenter = ["--segmenter", str(renamed)]
    for command in (
        ["evaluate", "small", *data],
        ["evaluate", "small", *data, "--single"],
        ["reconstruct", str(room)],
    ):
        assert main([*command, *segmenter, *looks, *out]) == 2
        assert "--looks 2 is for the network's own classes" in capsys.readouterr().err
