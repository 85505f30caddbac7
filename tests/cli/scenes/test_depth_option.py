"""--depth of `semgs reconstruct`: what it writes, and what it refuses."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest
import torch
from turned_cameras import SIZE, write_scene

import semgs
from semgs.cli.main import main
from semgs.files.images.pictures import write_png


def with_depth(folder: Path, frames: tuple[int, ...] = (0, 1, 2, 3), share: float = 1.0) -> Path:
    """The scene with a slanted wall as its depth, 1.2 m to 1.83 m from left to right, in some frames; in frame 1 only for a share of the rows."""

    def change(scene: dict) -> None:
        for index in frames:
            depths = np.broadcast_to(1200 + 10 * np.arange(SIZE[1]), SIZE).astype(np.uint16).copy()
            if index == 1:
                depths[int(share * SIZE[0]) :] = 0
            (folder / "depth").mkdir(exist_ok=True)
            write_png(folder / f"depth/{index:03d}.png", depths)
            scene["frames"][index]["depth_file_path"] = f"depth/{index:03d}.png"

    return write_scene(folder, change)


def refused(capsys: pytest.CaptureFixture[str], *arguments: str) -> str:
    capsys.readouterr()
    assert main(["reconstruct", *arguments]) == 2
    told = capsys.readouterr()
    assert told.out == ""
    assert told.err.count("\n") == 1
    return told.err


@pytest.mark.parametrize("model", ["small", pytest.param("mvsplat", marks=pytest.mark.long)])
def test_gaussians_lie_on_the_measured_wall_and_the_report_says_so(tmp_path: Path, capsys, model: str):
    scene, out = with_depth(tmp_path / "wall"), tmp_path / "out"
    arguments = ["reconstruct", str(scene), "--out", str(out), "--weights", "random", "--model", model]
    assert main([*arguments, "--context", "0", "3", "--size", "32x48", "--depth", "sensor"]) == 0
    told = capsys.readouterr().out
    numbers = json.loads((out / "report.json").read_text())
    assert numbers["depth"]["source"] == "sensor"
    assert [fit["measured"] for fit in numbers["depth"]["fits"]] == [1, 1]
    assert "sensor    images/003.png: 100 % measured; 1 / sensor = " in told
    assert "place" in numbers["seconds"]
    saved = semgs.load_scene(out)
    forward = saved.cameras.world_from_camera[0, :3, 2].float()
    inside = (saved.gaussians.means - saved.cameras.centres[0].float()) @ forward
    half = len(inside) // 2
    assert inside[:half].min().item() == pytest.approx(1.2, abs=0.02)
    assert inside[:half].max().item() == pytest.approx(1.83, abs=0.02)
    assert torch.unique(saved.depths[0], dim=0).shape[0] == 1


@pytest.mark.long
def test_classes_from_a_segmenter_go_with_sensor_depth(tmp_path: Path):
    scene, maps, out = with_depth(tmp_path / "wall"), tmp_path / "maps", tmp_path / "out"
    maps.mkdir()
    listed = [{"name": "left", "colour": [200, 10, 10]}, {"name": "right", "colour": [10, 10, 200]}]
    (maps / "classes.json").write_text(json.dumps({"name": "sides", "classes": listed}))
    for index in range(4):
        write_png(maps / f"{index:03d}.png", np.broadcast_to(np.arange(SIZE[1]) >= 32, SIZE).astype(np.uint8).copy())
    arguments = ["reconstruct", str(scene), "--out", str(out), "--weights", "random", "--context", "0", "3"]
    assert main([*arguments, "--depth", "both", "--segmenter", str(maps)]) == 0
    numbers = json.loads((out / "report.json").read_text())
    assert numbers["depth"]["source"] == "both"
    assert {entry["name"] for entry in numbers["classes"]} == {"left", "right"}


@pytest.mark.parametrize("source", ["sensor", "both"])
def test_frames_without_depth_are_refused_by_name(scene: Path, tmp_path: Path, capsys, source: str):
    arguments = [
        str(scene),
        "--out",
        str(tmp_path / "out"),
        "--weights",
        "random",
        "--context",
        "0",
        "3",
        "--depth",
        source,
    ]
    line = refused(capsys, *arguments)
    assert "transforms.json: expected a measured depth for every input frame" in line
    assert "found none for images/000.png, images/003.png" in line
    assert not (tmp_path / "out").exists()


def test_a_scene_of_which_only_some_input_frames_have_depth_is_refused(tmp_path: Path, capsys):
    scene = with_depth(tmp_path / "wall", frames=(0, 2))
    arguments = ["--out", str(tmp_path / "out"), "--weights", "random", "--depth", "sensor", "--context"]
    assert "found none for images/001.png" in refused(capsys, str(scene), *arguments, "0", "1")
    assert main(["reconstruct", str(scene), *arguments, "0", "2"]) == 0


def test_too_little_depth_is_refused_with_its_share(tmp_path: Path, capsys):
    """A quarter of the rows of frame 1."""
    scene = with_depth(tmp_path / "wall", share=0.25)
    arguments = ["--out", str(tmp_path / "out"), "--weights", "random", "--context", "0", "1", "--depth", "sensor"]
    line = refused(capsys, str(scene), *arguments)
    assert "images/001.png: expected a measured depth at 50 % of its pixels or more" in line
    assert "found 25 %" in line


def test_an_unknown_source_of_depth_is_refused(scene: Path, tmp_path: Path, capsys):
    assert "--depth" in refused(capsys, str(scene), "--out", str(tmp_path / "out"), "--depth", "lidar")
