"""`semgs view`, and `semgs reconstruct --html`."""

from __future__ import annotations

import json
import os
import re
import signal
import subprocess
import sys
from pathlib import Path

import pytest
from wall_and_chair import wall_and_chair

from semgs.cli.main import main
from semgs.scene.scene_file import FILE_NAME, save_scene


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    """A folder with the file of a scene."""
    (tmp_path / "out").mkdir()
    save_scene(tmp_path / "out" / FILE_NAME, wall_and_chair())
    return tmp_path / "out"


def test_a_page_is_written_from_a_folder_or_its_scene_file(folder: Path, capsys: pytest.CaptureFixture[str]):
    page = folder / "scene.html"
    for scene in (folder, folder / FILE_NAME):
        assert main(["view", str(scene), "--html", str(page), "--max-gaussians", "1500", "--overwrite"]) == 0
        assert re.fullmatch(rf"{page}: 1,500 of 4,000 Gaussians, \d\.\d MB\n", capsys.readouterr().out)
    assert page.read_text().startswith("<!doctype html>")


@pytest.mark.parametrize(
    ("options", "message"),
    [
        (
            ["--html", "{}/there.html"],
            "expected a new file, found one that exists; use --overwrite to replace it",
        ),
        (["--html", "{}/page.txt"], "page.txt; expected a file name that ends with .html"),
        (["--html", "{}/room/"], "room; expected a file name that ends with .html"),
        (["--html", "{}/a.html", "--port", "80"], "--port cannot go with --html"),
        (["--html", "{}/a.html", "--host", "0.0.0.0"], "--host cannot go with --html"),
        (["--views", "3"], "--views is for posed photos"),
        (["--weights", "small"], "--weights is for posed photos"),
        (["--html", "{}/no/page.html"], "expected a file in an existing folder"),
        (["--port", "70000"], "--port is 70000; expected 1 to 65535"),
        (["--host", "192.0.2.1"], "192.0.2.1: expected an IPv4 address of this machine"),
    ],
)
def test_what_cannot_work_is_refused_in_one_line(
    folder: Path, options: list[str], message: str, capsys: pytest.CaptureFixture[str]
):
    (folder / "there.html").touch()
    assert main(["view", str(folder), *(option.format(folder) for option in options)]) == 2
    assert message in capsys.readouterr().err.splitlines()[-1]


def test_without_viser_one_line_says_what_to_install_before_any_work(
    folder: Path, room: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
):
    monkeypatch.setitem(sys.modules, "viser", None)
    for command in (["view", str(folder)], ["reconstruct", str(room), "--out", str(folder / "new"), "--html"]):
        assert main(command) == 2
        assert "viewing needs viser: pip install -e '.[viewer]'" in capsys.readouterr().err
    assert not (folder / "new").exists()


def test_cameras_for_what_is_no_splat_are_refused_before_any_work(
    folder: Path, room: Path, capsys: pytest.CaptureFixture[str]
):
    for scene in (folder, room):
        assert main(["view", str(scene), "--cameras", str(room), "--html", str(folder / "a.html")]) == 2
        shown = capsys.readouterr()
        assert shown.err == f"semgs: error: --cameras is for splats of other programs; {scene} is not one\n"
        assert shown.out == ""


def test_the_checkpoint_of_a_training_is_refused_as_such(tmp_path: Path, capsys: pytest.CaptureFixture[str]):
    """Not as predictions of cameras, which may have the same ending."""
    (tmp_path / "step-000029999.pt").write_bytes(b"PK")
    assert main(["view", str(tmp_path / "step-000029999.pt")]) == 2
    assert "expected a scene or a splat, found a training checkpoint; export a PLY" in capsys.readouterr().err


def test_a_scene_that_is_not_there_is_refused(tmp_path: Path, capsys: pytest.CaptureFixture[str]):
    assert main(["view", str(tmp_path / "nowhere")]) == 2
    assert "nowhere: expected a folder with a scene, found nothing there" in capsys.readouterr().err


@pytest.mark.long
@pytest.mark.parametrize(
    ("host", "warnings"), [pytest.param("127.0.0.1", 0, marks=pytest.mark.long), ("localhost", 0), ("0.0.0.0", 1)]
)
def test_the_viewer_runs_until_an_interrupt_and_warns_once_if_others_can_reach_it(
    folder: Path, host: str, warnings: int
):
    command = [sys.executable, "-m", "semgs", "view", str(folder), "--up", "z", "--host", host]
    environment = {**os.environ, "PYTHONUNBUFFERED": "1"}
    with subprocess.Popen(
        command, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True, env=environment
    ) as process:
        assert process.stdout is not None
        line = process.stdout.readline()
        assert re.fullmatch(r"Open http://\S+:\d+ in a browser\. Ctrl-C stops the viewer\.\n", line), line
        process.send_signal(signal.SIGINT)
        rest, errors = process.communicate(timeout=60)
    assert (process.returncode, rest) == (0, "")
    assert errors.count("and has the token can see this scene; the connection is not encrypted") == warnings
    assert ("?token=" in line) == bool(warnings)
    assert len(errors.splitlines()) == warnings


def test_posed_photos_are_reconstructed_first(room: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]):
    assert main(["view", str(room), "--weights", "random", "--html", str(tmp_path / "room.html")]) == 0
    lines = capsys.readouterr().out.splitlines()
    assert lines[0] == "Reconstructed, and not saved: use semgs reconstruct to save it, or for more options"
    assert "room.html" in lines[1]
    assert len(lines) == 2


def test_the_report_links_the_page_that_was_made_with_it(
    room: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
):
    for out, options in (("with", ["--html"]), ("without", [])):
        assert main(["reconstruct", str(room), "--weights", "random", "--out", str(tmp_path / out), *options]) == 0
        linked = 'href="scene.html"' in (tmp_path / out / "report.html").read_text()
        assert (
            linked
            == (tmp_path / out / "scene.html").exists()
            == ("scene.html" in capsys.readouterr().out)
            == bool(options)
        )
    assert "page" in json.loads((tmp_path / "with/report.json").read_text())["seconds"]
