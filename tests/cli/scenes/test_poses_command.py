"""`semgs poses`, and photos in `semgs reconstruct`."""

from __future__ import annotations

import json
from pathlib import Path

import pytest
from pycolmap_photos import poses_of, take

from semgs.cli.main import main
from semgs.data.scenes import open_scene


def test_two_photos_become_a_scene_and_a_reconstruction(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    take(tmp_path / "kitchen", poses_of(2))
    arguments = ["reconstruct", str(tmp_path / "kitchen"), "--out", str(tmp_path / "out"), "--weights", "random"]
    assert main([*arguments, "--size", "48x64", "--focal", "250", "--scale-from", "p0 p1 0.5"]) == 0
    told = capsys.readouterr().out
    assert told.startswith("Estimating the cameras of 2 photos: about ")
    assert "The scale is from the 0.5 m between the cameras of p0.png and p1.png." in told
    report = json.loads((tmp_path / "out" / "report.json").read_text())
    assert report["scene"]["name"] == "kitchen"
    assert report["scene"]["path"] == str(tmp_path / "out" / "cameras")
    scene = open_scene(tmp_path / "out" / "cameras")
    assert (len(scene), scene.unit) == (2, "metric")
    assert sorted(path.name for path in tmp_path.iterdir()) == ["kitchen", "out"]


def test_photos_that_are_not_kept_are_named_nowhere_as_if_they_were(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    photos, out = tmp_path / "kitchen", tmp_path / "out"
    take(photos, poses_of(2))
    arguments = ["reconstruct", str(photos), "--out", str(out), "--weights", "random", "--size", "48x64"]
    assert main([*arguments, "--focal", "250", "--drop-photos"]) == 0
    told = capsys.readouterr().out
    assert not (out / "cameras").exists()
    assert json.loads((out / "report.json").read_text())["scene"]["path"] == str(photos)
    assert not [text for text in (told, (out / "report.html").read_text()) if str(out / "cameras") in text]
    assert sorted(path.name for path in tmp_path.iterdir()) == ["kitchen", "out"]


def test_a_scene_is_not_photos(room: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["poses", str(room), str(tmp_path / "out")]) == 2
    assert (
        "expected a folder of photos without cameras, or a video, found a scene, which has cameras"
        in capsys.readouterr().err
    )


def test_cameras_are_written_in_colmaps_format(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    take(tmp_path / "photos", poses_of(2))
    assert (
        main(["poses", str(tmp_path / "photos"), "--out", str(tmp_path / "out"), "--as", "colmap", "--focal", "250"])
        == 0
    )
    assert "a scene of 2 frames" in capsys.readouterr().out
    assert open_scene(tmp_path / "out").layout == "COLMAP"
