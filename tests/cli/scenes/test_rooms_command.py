"""`semgs rooms`: a data set, a sheet, and one line for what cannot be."""

from __future__ import annotations

import errno
import json
from pathlib import Path

import pytest

pytest.importorskip("embreex")

from semgs.cli.main import main
from semgs.files.images.pictures import read_rgb
from semgs_rooms.sets import room_stream

SMALL = ["--size", "32x48", "--frames", "2", "--workers", "0"]


def test_it_writes_scenes_and_tells_what_is_in_them(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    out = tmp_path / "rooms"
    assert main(["rooms", "--out", str(out), "--scenes", "2", "--seed", "3", *SMALL]) == 0
    told = capsys.readouterr()
    assert told.err == ""
    assert "2 scenes of 2 frames" in told.out
    assert "wall" in told.out
    assert json.loads((out / "index.json").read_text())["seed"] == 3
    assert (out / "scene_00001" / "transforms.json").is_file()
    # Again is nothing to do; other settings are refused.
    assert main(["rooms", str(out), "--scenes", "2", "--seed", "3", *SMALL]) == 0
    capsys.readouterr()
    assert main(["rooms", str(out), "--scenes", "2", "--seed", "4", *SMALL]) == 2
    assert "seed is 3 there, not 4" in capsys.readouterr().err


@pytest.mark.parametrize(
    ("arguments", "told"),
    [
        (["OUT", "--scenes", "0"], "--scenes: expected a whole number, 1 or more"),
        (["OUT", "--size", "0x0"], "--size: expected sides from 32 to 4096 pixels, found 0x0"),
        (["OUT", "--size", "auto"], "--size: expected height x width in pixels, such as 240x320, found 'auto'"),
        (["OUT", "--frames", "1"], "frames is 1"),
        (["OUT", "--seed", "-1"], "seed is -1"),
        (["OUT", "--workers", "-1"], "--workers: expected a whole number, 0 or more"),
        (["OUT", "--style", "plain"], "--style: expected one of "),
        (["OUT", "--render", "traced"], "there is no option --render"),
        (["OUT", "--assets", "/nowhere/at/all"], "no such folder"),
        (["OUT", "--assets", "EMPTY"], "missing"),
        ([], "expected a folder to write, as in semgs rooms --out OUT, or --sheet FILE.png; see"),
        (["--sheet", "sheet.jpg"], "ends in .png"),
        (["--sheet", "sheet.png", "--size", "48x64"], "--size is for --out"),
        (["--sheet", "sheet.png", "--workers", "0"], "--workers is for --out"),
        (["--sheet", "/nowhere/at/all/sheet.png"], "an existing folder"),
    ],
)
def test_what_cannot_be_ends_with_2_and_one_line(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], arguments: list[str], told: str
) -> None:
    (tmp_path / "empty").mkdir()
    folders = {"OUT": str(tmp_path / "out"), "EMPTY": str(tmp_path / "empty")}
    given = [folders.get(word, word) for word in arguments]
    assert main(["rooms", *given]) == 2
    err = capsys.readouterr().err
    assert told in err
    assert err.count("\n") == 1
    assert not (tmp_path / "out").exists()


def test_a_folder_of_something_else_is_refused(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    (tmp_path / "mine.txt").write_text("mine")
    assert main(["rooms", str(tmp_path), *SMALL]) == 2
    assert "something else" in capsys.readouterr().err
    assert [path.name for path in tmp_path.iterdir()] == ["mine.txt"]


def test_a_full_disk_is_one_line(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    def full(*_: object, **__: object) -> None:
        raise OSError(errno.ENOSPC, "No space left on device", "x")

    monkeypatch.setattr("semgs_rooms.sets.room_scenes.write_views", full)
    assert main(["rooms", str(tmp_path / "rooms"), "--scenes", "1", *SMALL]) == 2
    assert "the disk is full" in capsys.readouterr().err


def test_a_sheet_shows_frames_beside_their_labels(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(room_stream, "SHEET_FRAMES", 6)
    monkeypatch.setattr(room_stream, "FRAME_SIZE", (24, 32))
    assert main(["rooms", "--sheet", str(tmp_path / "sheet.png"), "--style", "other"]) == 0
    picture = read_rgb(tmp_path / "sheet.png")
    assert picture.shape == (24 + 2 * room_stream.LEGEND_PX, 6 * 2 * 32, 3)
    assert [path.name for path in tmp_path.iterdir()] == ["sheet.png"]


def test_a_sheet_replaces_no_file(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    file = tmp_path / "sheet.png"
    file.write_bytes(b"mine")
    assert main(["rooms", "--sheet", str(file)]) == 2
    assert capsys.readouterr().err == (
        f"semgs: error: {file}: expected a new file, found one that exists; choose another name\n"
    )
    assert file.read_bytes() == b"mine"
