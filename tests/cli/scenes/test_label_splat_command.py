"""`semgs label-splat`: what it writes, says and refuses."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest
import torch
from known_scenes import write_scene

import semgs
from semgs.cli.main import main
from semgs.export.ply import save_ply
from semgs.geometry.gaussians import Appearance, Gaussians

NAMES = ("wall", "mug")
COUNT, SIZE = 5, (32, 48)
OUT_FILES = {
    "report.html",
    "report.json",
    "gaussians.ply",
    "semantics.ply",
    "export.json",
    "scene.safetensors",
    "renders",
}


@pytest.fixture(scope="module")
def given(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A folder with a room, and a splat of it in the coordinates of its poses; not to be changed."""
    folder = tmp_path_factory.mktemp("label_splat")
    pose = torch.from_numpy(write_scene(folder / "room", COUNT, SIZE).frames[1].world_from_camera)
    spread = torch.randn(300, 3, generator=torch.Generator().manual_seed(0), dtype=torch.float64)
    means = (spread * torch.tensor([0.7, 0.7, 0.01]) + torch.tensor([0.0, 0, 2])) @ pose[:3, :3].mT + pose[:3, 3]
    shape = Appearance(torch.eye(4)[:1].repeat(300, 1), torch.full((300, 3), 0.1), torch.ones(300, 1, 3))
    save_ply(folder / "wall.ply", Gaussians(means.float(), torch.full((300,), 0.9), shape))
    return folder


@pytest.fixture
def maps(given: Path, tmp_path: Path) -> Path:
    """Class maps of all photos that say wall by 0.9."""
    folder, scene = tmp_path / "maps", semgs.open_scene(given / "room")
    for frame in scene.frames:
        file = (folder / frame.name).with_suffix(".npz")
        file.parent.mkdir(parents=True, exist_ok=True)
        np.savez(file, np.stack((np.full(SIZE, 0.9, np.float16), np.full(SIZE, 0.1, np.float16))))
    table = {
        "name": "few",
        "classes": [{"name": name, "colour": [1, 2, 3 + place]} for place, name in enumerate(NAMES)],
    }
    (folder / "classes.json").write_text(json.dumps(table))
    return folder


def label_splat(given: Path, out: Path, *options: object) -> int:
    """Run the command; its exit code."""
    splat, room = given / "wall.ply", given / "room"
    return main(["label-splat", str(splat), "--cameras", str(room), "--out", str(out), *map(str, options)])


def test_the_classes_of_maps_reach_the_gaussians_and_all_files_are_written(
    given: Path, maps: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    capsys.readouterr()
    assert label_splat(given, tmp_path / "out", "--segmenter", maps, "--hold-out", "3") == 0
    shown = capsys.readouterr().out
    assert {path.name for path in (tmp_path / "out").iterdir()} == OUT_FILES | {".semgs"}
    for name in OUT_FILES:
        assert str(tmp_path / "out" / name) in shown
    scene, before = semgs.load_scene(tmp_path / "out"), semgs.load_splat(given / "wall.ply").gaussians
    assert scene.classes is not None
    assert scene.classes.names == NAMES
    torch.testing.assert_close(scene.gaussians.means, before.means, rtol=0, atol=0)
    torch.testing.assert_close(scene.gaussians.colour.scales, before.colour.scales, rtol=0, atol=0)
    shares = scene.gaussians.semantic.features
    voted = shares[:, 0] > 0.6
    assert voted.float().mean() > 0.5
    torch.testing.assert_close(shares[voted, 0], torch.full_like(shares[voted, 0], 0.901 / 1.002), rtol=1e-3, atol=0)
    numbers = json.loads((tmp_path / "out" / "report.json").read_text())
    assert numbers["splat"] == {
        "name": "wall.ply",
        "format": "PLY",
        "photos": 3,
    }  # of five; the second and the last are held out
    assert {view["role"] for view in numbers["views"]} == {"context", "target"}
    assert numbers["model"]["parameters"] == 0
    assert (given / "wall.ply").exists()


def test_the_network_classifies_each_photo_by_itself(given: Path, tmp_path: Path) -> None:
    assert label_splat(given, tmp_path / "out", "--every", "2", "--hold-out", "0") == 0
    scene = semgs.load_scene(tmp_path / "out")
    assert scene.classes is not None
    assert len(scene.classes) == 20
    assert scene.frames == tuple(frame.name for frame in semgs.open_scene(given / "room").frames[::2])
    numbers = json.loads((tmp_path / "out" / "report.json").read_text())
    assert numbers["model"]["weights"].startswith("small.safetensors: version ")


def test_what_cannot_be_labelled_is_refused_with_one_line(
    given: Path, maps: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    capsys.readouterr()

    def refused(*options: object) -> str:
        assert label_splat(given, tmp_path / "no", *options) == 2
        line = capsys.readouterr().err
        assert line.count("\n") == 1
        assert not (tmp_path / "no").exists()
        return line

    assert "--hold-out 1 holds out every photo" in refused("--hold-out", "1")
    assert "--weights cannot go with --segmenter" in refused("--segmenter", maps, "--weights", "small")
    assert "--with-own-classes is for semgs reconstruct" in refused("--segmenter", maps, "--with-own-classes")
    photo = given / "room" / "images" / "000.png"
    assert main(["label-splat", str(photo), "--cameras", str(given / "room"), "--out", str(tmp_path / "no")]) == 2
    assert f"semgs: error: {photo}: expected a splat" in capsys.readouterr().err
