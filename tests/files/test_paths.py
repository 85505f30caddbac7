"""Paths that lead nowhere."""

from __future__ import annotations

import pwd
import subprocess
import sys
from pathlib import Path

import pytest
from privileges import permissions_hold

from semgs.files.errors import InputError
from semgs.files.paths import existing_folder, found_at, typed_path


def test_a_folder_and_a_file_in_it_lead_to_the_folder(tmp_path):
    (tmp_path / "transforms.json").touch()
    assert existing_folder(tmp_path) == tmp_path
    assert existing_folder(tmp_path / "transforms.json") == tmp_path


def test_a_path_that_leads_nowhere_is_told_with_the_part_that_exists(tmp_path):
    with pytest.raises(InputError, match=f"nothing there; the path exists up to {tmp_path}$"):
        existing_folder(tmp_path / "a" / "b")


def test_a_missing_folder_is_told_without_torch():
    code = (
        "import sys\n"
        "from semgs.files.paths import existing_folder\n"
        "try: existing_folder('nowhere/at/all')\n"
        "except ValueError: print('torch' in sys.modules, 'cv2' in sys.modules)"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert done.stdout.split() == ["False", "False"]


def test_what_is_at_a_path_is_told_whatever_the_path(tmp_path):
    (tmp_path / "file").touch()
    (tmp_path / "closed").mkdir(mode=0o600)
    expected = {
        "": "a folder",
        "file": "a file",
        "file/below": "nothing there",
        "none": "nothing there",
        "n" * 256: "nothing there",
    }
    assert {name: found_at(tmp_path / name) for name in expected} == expected
    with permissions_hold():
        assert found_at(tmp_path / "closed") == "a folder"
        with pytest.raises(InputError, match="closed/file: expected a path that can be read, found Permission denied"):
            found_at(tmp_path / "closed" / "file")


def test_a_scene_that_may_not_be_reached_or_named_is_told_in_one_line(tmp_path):
    (tmp_path / "closed").mkdir(mode=0o600)
    with permissions_hold(), pytest.raises(InputError, match="found Permission denied"):
        existing_folder(tmp_path / "closed" / "scene")
    with pytest.raises(InputError, match="found File name too long"):
        existing_folder(tmp_path / ("n" * 256))


def test_a_tilde_is_replaced_at_the_beginning_alone(tmp_path, monkeypatch):
    monkeypatch.setenv("HOME", str(tmp_path))
    assert typed_path("~") == tmp_path
    assert typed_path("~/a/~b") == tmp_path / "a" / "~b"
    assert typed_path("a/~/b") == Path("a/~/b")
    assert typed_path("~root/a") == Path(pwd.getpwnam("root").pw_dir) / "a"
    assert existing_folder("~") == tmp_path


def test_nobodys_home_and_an_empty_path_are_refused():
    with pytest.raises(
        InputError, match=r"^~nosuchuser/x: expected a user nosuchuser, found none; .* \./~nosuchuser/x$"
    ):
        typed_path("~nosuchuser/x")
    with pytest.raises(InputError, match=r'^"": expected a path, found an empty one; use \. for the current folder$'):
        existing_folder("")
