"""Photos and clips that cannot become a scene: exit code 2, one line, and nothing is written."""

from __future__ import annotations

import sys
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
from clip_files import write_clip
from pycolmap_photos import PLANES, picture, poses_of, take

from semgs.cli.main import main

FRAME = picture(poses_of(1)[0], PLANES)


def one_photo(path: Path) -> Path:
    return take(path / "in", poses_of(1)).folder


def thousands(path: Path) -> Path:
    (path / "in").mkdir()
    for index in range(3000):
        (path / "in" / f"{index}.jpg").touch()
    return path / "in"


def copies_alone(path: Path) -> Path:
    return take(path / "in", poses_of(1)[[0, 0, 0]]).folder


def formats_alone(path: Path) -> Path:
    (path / "in").mkdir()
    for name in ("a.webp", "b.CR2"):
        (path / "in" / name).touch()
    return path / "in"


def still(path: Path) -> Path:
    return write_clip(path / "in.mp4", [FRAME] * 5)


def black(path: Path) -> Path:
    return write_clip(path / "in.mp4", [np.zeros_like(FRAME)] * 5)


def no_video(path: Path) -> Path:
    (path / "in.mp4").write_bytes(b"no video")
    return path / "in.mp4"


@pytest.mark.parametrize("command", ["poses", "reconstruct"])
@pytest.mark.parametrize(
    ("make", "said"),
    [
        (one_photo, "expected two or more photos, found 1"),
        (thousands, "expected at most 150 photos, found 3,000"),
        (copies_alone, "2 of 3 photos are copies of another"),
        (formats_alone, "2 of 2 photos have a format that is not read (.cr2, .webp)"),
        (still, "expected a video in which the camera moves, found the same picture in 5 frames"),
        (black, "found 5 black or blank frames"),
        (no_video, "expected a video in MP4, MOV, AVI, MKV or WebM, found something else"),
    ],
)
def test_unusable_photos_are_refused_with_one_line(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], make: Callable[[Path], Path], said: str, command: str
) -> None:
    path, out = make(tmp_path), tmp_path / "out"
    arguments = [command, str(path), str(out)] if command == "poses" else [command, str(path), "--out", str(out)]
    assert said in refusal(arguments, capsys)
    assert list(tmp_path.iterdir()) == [path]


def test_without_pycolmap_the_command_names_the_extra(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setitem(sys.modules, "pycolmap", None)
    monkeypatch.setattr("platform.machine", lambda: "x86_64")
    photos = take(tmp_path / "in", poses_of(2)).folder
    line = refusal(["reconstruct", str(photos), "--out", str(tmp_path / "out")], capsys)
    assert "pip install -e '.[sfm]'" in line
    assert list(tmp_path.iterdir()) == [photos]


def refusal(arguments: list[str], capsys: pytest.CaptureFixture[str]) -> str:
    """The one line of a command that ends with exit code 2."""
    assert main(arguments) == 2
    lines = capsys.readouterr().err.splitlines()
    assert len(lines) == 1
    return lines[0]
