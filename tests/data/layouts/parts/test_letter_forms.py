"""Files whose names differ from those that are asked for in the form of their letters only."""

from __future__ import annotations

import unicodedata
from pathlib import Path

import pytest

from semgs.data.confined import confine_to
from semgs.data.layouts.parts.letter_forms import in_other_form
from semgs.files.errors import InputError

ASKED = "Küche/é.png"
APART = unicodedata.normalize("NFD", ASKED)


def put(folder: Path, name: str) -> Path:
    """A new file."""
    (folder / name).parent.mkdir(parents=True, exist_ok=True)
    (folder / name).write_bytes(b"x")
    return folder / name


def test_forms_of_folders_and_files_may_differ(tmp_path: Path) -> None:
    assert ASKED != APART
    assert in_other_form("list", tmp_path / "none", ASKED) is None
    assert in_other_form("list", tmp_path, ASKED) is None
    file = put(tmp_path, APART)
    assert in_other_form("list", tmp_path, ASKED) == file
    assert in_other_form("list", tmp_path, str(tmp_path / ASKED)) == file
    assert in_other_form("list", file.parent, "../" + ASKED) == file.parent / ".." / APART
    for other in ("Küche/e.png", "Kuche/é.png", "Küche/É.png", "Küche/é.png/a"):
        assert in_other_form("list", tmp_path, other) is None


def test_two_that_may_be_meant_are_none(tmp_path: Path) -> None:
    # "ế" has three forms; the one that is asked for is not there
    for form in ("e\u0302\u0301.png", "\u00ea\u0301.png"):
        put(tmp_path, form)
    assert in_other_form("list", tmp_path, "\u1ebf.png") is None


def test_a_confined_process_finds_nothing_outside(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("SEMGS_CONFINED_TO", "")
    scene = tmp_path / "scene"
    file = put(scene, APART)
    put(tmp_path, APART)
    (scene / unicodedata.normalize("NFD", "ö")).symlink_to(tmp_path)
    (scene / unicodedata.normalize("NFD", "ä.png")).symlink_to(tmp_path / APART)
    confine_to(scene)
    assert in_other_form("list", scene, ASKED) == file
    for name in ("../" + ASKED, str(tmp_path / ASKED), "ö/" + ASKED, "ö/none é.png", "ä.png"):
        with pytest.raises(InputError, match="files inside the scene's folder"):
            in_other_form("list", scene, name)
