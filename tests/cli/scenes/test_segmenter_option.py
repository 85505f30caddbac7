"""`semgs reconstruct --segmenter`."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest
from PIL import Image

from semgs.cli.main import main
from semgs.data.scenes import open_scene
from semgs.data.tables.classes import SCANNET20


@pytest.fixture
def maps(room: Path, tmp_path: Path) -> Path:
    """A folder that says chair on the left half of every photo of the room, and sofa on the right."""
    folder = tmp_path / "maps"
    for frame in open_scene(room).frames:
        values = np.full(frame.lens.size, 4, np.uint8)
        values[:, frame.lens.size[1] // 2 :] = 5
        path = folder / Path(frame.name).with_suffix(".png")
        path.parent.mkdir(parents=True, exist_ok=True)
        Image.fromarray(values).save(path)
    listed = [
        {"name": name, "colour": list(colour)} for name, colour in zip(SCANNET20.names, SCANNET20.colours, strict=True)
    ]
    (folder / "classes.json").write_text(json.dumps({"name": "scannet20", "classes": listed}))
    return folder


@pytest.mark.parametrize("network", [["--weights", "random"], ["--weights", "random", "--model", "mvsplat"]])
def test_a_scene_has_the_classes_of_the_maps_with_every_network(
    room: Path, maps: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str], network: list[str]
):
    out = tmp_path / "out"
    command = [
        "reconstruct",
        str(room),
        "--out",
        str(out),
        "--context",
        "0",
        "3",
        "--segmenter",
        str(maps),
        "--size",
        "32x48",
    ]
    assert main([*command, *network]) == 0
    numbers = json.loads((out / "report.json").read_text())
    assert {one["name"] for one in numbers["classes"]} <= {"chair", "sofa"}
    assert numbers["model"]["segmenter"] == f"{maps}; fused over the input views"
    assert "segment" in numbers["seconds"]
    assert (out / "semantics.ply").is_file()
    told = capsys.readouterr().out
    assert f"classes   {maps}; fused over the input views" in told
    page = (out / "report.html").read_text()
    assert "Classes from" in page
    assert 'href="segmenter/"' not in page, "there are no maps of a network"


@pytest.mark.parametrize(
    ("options", "told"),
    [
        (["--with-own-classes"], "--with-own-classes is for --segmenter"),
        (["--classes", "own"], "--classes is for --segmenter"),
        (["--segmenter", "nowhere.onnx"], "nowhere.onnx"),
        (
            ["--segmenter", "maps", "--with-own-classes", "--classes", "own"],
            "--classes own cannot go with --with-own-classes",
        ),
    ],
)
def test_options_that_do_not_fit_end_with_one_line(
    room: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str], options: list[str], told: str
):
    command = ["reconstruct", str(room), "--out", str(tmp_path / "out"), "--weights", "random", "--context", "0", "3"]
    assert main([*command, *options]) == 2
    errors = capsys.readouterr().err.strip().splitlines()
    assert told in errors[-1]
    assert not (tmp_path / "out").exists()


def test_a_missing_map_is_named_and_nothing_is_written(
    room: Path, maps: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
):
    next(maps.rglob("003.png")).unlink()
    command = ["reconstruct", str(room), "--out", str(tmp_path / "out"), "--weights", "random", "--context", "0", "3"]
    assert main([*command, "--segmenter", str(maps)]) == 2
    assert "a map of frame images/003.png" in capsys.readouterr().err
    assert not (tmp_path / "out").exists()
