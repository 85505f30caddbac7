"""A robot's recording on the command line: it works, or says in one line what to name."""

from __future__ import annotations

import json
import sys
from pathlib import Path

import pytest
from bags import Bag, robot, times
from miniatures import miniature

from semgs.cli.main import main

ROOM = miniature(frames=4)


def refused(capsys: pytest.CaptureFixture[str], *arguments: object) -> str:
    """The line that `semgs reconstruct` refuses with."""
    assert main(["reconstruct", *map(str, arguments), "--weights", "random"]) == 2
    told = capsys.readouterr()
    assert told.out == ""
    assert told.err.count("\n") == 1
    return told.err


def test_what_is_ambiguous_or_missing_is_listed(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    bag = robot(ROOM)
    for time, image in zip(times(ROOM), ROOM.images, strict=True):
        bag.image(time, "/rear/image_raw", image, "rgb8")
    path, out = bag.write(tmp_path / "run 1"), tmp_path / "out"
    line = refused(capsys, path, "--out", out)
    assert "run 1: camera: expected one camera, found /camera/color/image_raw (4), /rear/image_raw (4)" in line
    assert "--camera TOPIC" in line
    assert "world: expected poses of" in refused(capsys, path, "--out", out, "--camera", "/rear", "--world", "mars")
    empty = Bag()
    empty.info()
    assert "expected topics of type Image or CompressedImage" in refused(
        capsys, empty.write(tmp_path / "b"), "--out", out
    )
    assert not out.exists()


def test_without_rosbags_the_extra_is_named(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    (tmp_path / "run.mcap").write_bytes(b"\x89MCAP0\r\n")
    monkeypatch.setitem(sys.modules, "rosbags.highlevel", None)
    line = refused(capsys, tmp_path / "run.mcap", "--out", tmp_path / "out")
    assert "reading it needs rosbags: pip install -e '.[ros]' in SemGS's folder" in line


@pytest.mark.long
def test_a_bag_is_reconstructed_and_prepared_by_naming_camera_and_world(tmp_path: Path) -> None:
    path = robot(ROOM).write(tmp_path / "run 1")
    named = ["--camera", "/camera/color", "--world", "map"]
    assert main(["reconstruct", str(path), "--out", str(tmp_path / "out"), "--weights", "random", *named]) == 0
    report = json.loads((tmp_path / "out" / "report.json").read_text())
    assert report["scene"]["layout"] == "ROS bag"
    assert main(["prepare", str(path), str(tmp_path / "small"), "--size", "32x48", *named]) == 0
    assert (tmp_path / "small" / "run_1.zip").is_file()
