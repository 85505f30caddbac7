"""--depth with maps from elsewhere, of `semgs reconstruct` and `semgs evaluate`."""

from __future__ import annotations

import json
from pathlib import Path

import known_scenes
import numpy as np
import pytest
import torch
from turned_cameras import SIZE, write_scene

import semgs
from semgs.cli.commands.networks.evaluate import Evaluate
from semgs.cli.main import main
from semgs.depth_maps.depth_source import FrameMaps
from semgs.evaluation.frames.frame_plan import make_plan
from semgs.evaluation.frames.protocols import neighbours
from semgs.files.images.pictures import write_png


def write_maps(folder: Path, count: int = 4) -> Path:
    """Inverse depth of a slanted wall, up to scale and shift."""
    folder.mkdir()
    for index in range(count):
        np.save(folder / f"{index:03d}.npy", np.broadcast_to(np.linspace(1, 2, SIZE[1], dtype=np.float32), SIZE))
    return folder


def test_maps_of_a_folder_shape_the_scene_and_the_summary_says_so(tmp_path: Path, capsys):
    """A sensor measured a wall that falls back from 1.2 m to 1.83 m. The maps are twice its inverse depth plus 0.1, so 1 / depth = map / 2 - 0.05."""
    wall = (1200 + 10 * np.arange(SIZE[1])).astype(np.uint16)

    def measure(scene: dict) -> None:
        (tmp_path / "wall" / "depth").mkdir()
        for index, frame in enumerate(scene["frames"]):
            write_png(tmp_path / "wall" / f"depth/{index:03d}.png", np.broadcast_to(wall, SIZE).copy())
            frame["depth_file_path"] = f"depth/{index:03d}.png"

    scene, maps, out = write_scene(tmp_path / "wall", measure), tmp_path / "maps", tmp_path / "out"
    maps.mkdir()
    for index in range(4):
        np.save(maps / f"{index:03d}.npy", np.broadcast_to(2000 / wall + 0.1, SIZE).astype(np.float32))
    arguments = ["reconstruct", str(scene), "--out", str(out), "--context", "0", "3", "--weights", "random"]
    assert main([*arguments, "--depth", str(maps), "--depth-meaning", "inverse"]) == 0
    told = [line for line in capsys.readouterr().out.splitlines() if line.startswith("maps")]
    assert told[1].startswith("maps      images/003.png: 100 % known; 1 / depth = ")
    numbers = json.loads((out / "report.json").read_text())
    assert numbers["depth"]["source"] == "maps"
    for fit in numbers["depth"]["fits"]:
        assert (fit["scale"], fit["shift"]) == (pytest.approx(0.5, rel=1e-3), pytest.approx(-0.05, abs=1e-3))
    assert {"depth", "place"} <= numbers["seconds"].keys()
    depths = semgs.load_scene(out).depths[0]
    torch.testing.assert_close(depths, torch.from_numpy(wall / 1000).float().expand(depths.shape), rtol=0.02, atol=0)


@pytest.mark.parametrize(
    ("options", "message"),
    [
        (["--depth", "nowhere"], "--depth is nowhere; expected network, sensor, both, maps, a folder of depth maps, "),
        (["--depth", "senor"], "--depth is senor; did you mean sensor?; expected network"),
        (["--depth", "{maps}"], "give --depth-meaning metric, scaled or inverse"),
        (["--depth", "sensor", "--depth-meaning", "metric"], "--depth-meaning is for --depth maps or SOURCE"),
        (["--depth", "maps"], "a depth map of this frame, as --depth maps needs"),
        (["--depth", "{empty}", "--depth-meaning", "scaled"], "a depth map of frame images/000.png"),
    ],
)
def test_what_cannot_be_used_is_refused_in_one_line(tmp_path: Path, capsys, options: list[str], message: str):
    scene, maps = write_scene(tmp_path / "wall"), write_maps(tmp_path / "maps")
    (tmp_path / "empty").mkdir()
    filled = [option.format(maps=maps, empty=tmp_path / "empty") for option in options]
    arguments = [
        "reconstruct",
        str(scene),
        "--out",
        str(tmp_path / "out"),
        "--weights",
        "random",
        "--context",
        "0",
        "3",
    ]
    assert main([*arguments, *filled]) == 2
    told = capsys.readouterr()
    assert message in told.err
    assert told.err.count("\n") == 1
    assert not (tmp_path / "out").exists()


@pytest.mark.parametrize(
    ("options", "message"),
    [
        (["--depth", "{maps}", "--workers", "2"], "--depth cannot go with --workers"),
        (["--depth-meaning", "scaled"], "--depth-meaning is for --depth"),
        (["--depth", "{maps}", "--single"], "--depth cannot go with --single"),
        (
            ["--depth", "sensor", "--views", "2"],
            "expected measured depth of each input view for --depth sensor, found none",
        ),
        (
            ["--depth", "both", "--views", "2"],
            "both: expected maps, a folder of depth maps, an exported network (.onnx, .tflite), a model ",
        ),
    ],
)
def test_evaluate_refuses_what_cannot_go_together(tmp_path: Path, capsys, options: list[str], message: str):
    maps = write_maps(tmp_path / "maps")
    filled = [option.format(maps=maps) for option in options]
    scene = write_scene(tmp_path / "wall")
    assert main(["evaluate", "small", "--data", str(scene), "--out", str(tmp_path / "out"), *filled]) == 2
    assert message in capsys.readouterr().err


def test_the_report_of_an_evaluation_says_from_which_maps_depth_is(tmp_path: Path, capsys):
    scene, maps = write_scene(tmp_path / "wall"), write_maps(tmp_path / "maps")
    arguments = ["evaluate", "small", "--data", str(scene), "--out", str(tmp_path / "out"), "--views", "2"]
    assert main([*arguments, "--size", "32x48", "--depth", str(maps), "--depth-meaning", "inverse"]) == 0
    notes = json.loads((tmp_path / "out" / "report.json").read_text())["notes"]
    assert notes[0] == f"The depth is from the network and {maps}."
    assert f"note  {notes[0]}" in capsys.readouterr().out


def test_an_evaluation_with_the_true_depth_of_its_input_views_says_so(tmp_path: Path):
    scene = known_scenes.write_scene(tmp_path / "attic", 4, (36, 48))
    asked = Evaluate(scene.path, tmp_path / "out", "small", depth="maps")
    plan = make_plan("neighbours", neighbours, [scene], [2], (36, 48))
    assert asked._remarks(plan, None, lambda scene: FrameMaps()) == (
        "The depth is from the network and the scene's own depth maps.",
        "The same maps are the truth of the depth error.",
    )
