import json
from pathlib import Path

import pytest

from semgs.files.claims import is_begun
from semgs.files.errors import InputError

SETTINGS = {"seed": 7, "size": [36, 48]}


def begun(folder: Path, settings: dict = SETTINGS) -> bool:
    return is_begun(folder / "settings.json", settings, "a set of things")


def test_a_new_an_empty_and_a_half_begun_folder_are_free(tmp_path: Path):
    assert not begun(tmp_path / "new")
    assert not begun(tmp_path)
    (tmp_path / ".settings.json.0123abcd.part").touch()  # what a killed call left
    assert not begun(tmp_path)


def test_a_folder_of_the_same_settings_is_gone_on_with_whatever_else_is_in_it(tmp_path: Path):
    (tmp_path / "settings.json").write_text(json.dumps(SETTINGS))
    (tmp_path / "scene_0").mkdir()
    assert begun(tmp_path)


def test_every_setting_that_differs_is_named(tmp_path: Path):
    (tmp_path / "settings.json").write_text(json.dumps({"seed": 8, "size": [36, 50]}))
    told = (
        r"is a set of things with other settings: seed is 8 there, not 7; size is \[36, 50\] there, not \[36, 48\]; use"
    )
    with pytest.raises(ValueError, match=told):
        begun(tmp_path)


@pytest.mark.parametrize("text", ["[]", '{"seed": 7}', '{"seed": 7, "size": [36, 48], "more": 1}', "{", ""])
def test_a_record_of_something_else_is_refused(tmp_path: Path, text: str):
    (tmp_path / "settings.json").write_text(text)
    with pytest.raises(InputError, match="the settings of a set of things"):
        begun(tmp_path)


def test_a_new_folder_is_not_named_like_a_file(tmp_path: Path):
    with pytest.raises(InputError, match=r"the name of a folder, found one that ends with \.zip; leave"):
        begun(tmp_path / "set.zip")


def test_a_file_and_a_folder_of_something_else_are_refused(tmp_path: Path):
    (tmp_path / "mine.txt").touch()
    for folder in (tmp_path, tmp_path / "mine.txt"):
        with pytest.raises(
            InputError, match="a new or empty folder, or a set of things to resume, found something else"
        ):
            begun(folder)


def test_a_link_that_leads_nowhere_is_no_new_folder(tmp_path: Path):
    (tmp_path / "out").symlink_to("gone")
    with pytest.raises(
        InputError, match="out: expected a new or empty folder, or a set of things to resume, found a broken link"
    ):
        begun(tmp_path / "out")
