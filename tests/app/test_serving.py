"""What the app serves of a room, and what it says before it starts."""

from __future__ import annotations

from pathlib import Path

import pytest

from semgs.app.serving import folder_page, served_path
from semgs.cli.main import main


@pytest.fixture
def room(tmp_path: Path) -> Path:
    """A room with files that are served, and others that are not."""
    folder = tmp_path / "room"
    (folder / "renders").mkdir(parents=True)
    (folder / "renders" / "a #1 <b>.png").touch()
    (folder / ".semgs").touch()
    (folder / "report.html").touch()
    (tmp_path / "secret").touch()
    return folder


@pytest.mark.parametrize("name", ["report.html", "renders/", "renders/a #1 <b>.png"])
def test_what_a_report_links_to_is_served(room: Path, name: str):
    assert served_path(room, name) == room / name


@pytest.mark.parametrize(
    "name",
    ["", "/", "renders", ".semgs", "../secret", "../", "renders/../../secret", "absent/", "absent", "a\0b", 300 * "x"],
)
def test_nothing_else_is_served(room: Path, name: str):
    assert served_path(room, name) is None


def test_a_folder_of_a_room_is_a_page_of_links(room: Path):
    assert '<li><a href="a%20%231%20%3Cb%3E.png">a #1 &lt;b&gt;.png</a></li>' in folder_page(room / "renders")


@pytest.mark.parametrize("option", ["--segmenter", "--depth"])
def test_a_source_that_is_not_there_is_told_before_the_app_starts(
    option: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    missing = tmp_path / "a.onnx"
    assert main(["app", "--folder", str(tmp_path / "app"), option, str(missing)]) == 2
    assert capsys.readouterr().err == (
        f"semgs: error: {missing}: expected an exported network (.onnx, .tflite), a model folder of transformers, or hf:OWNER/NAME, found nothing there\n"
    )
    assert not (tmp_path / "app").exists()
