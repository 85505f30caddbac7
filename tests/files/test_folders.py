from __future__ import annotations

import errno
import os
import re
from pathlib import Path

import pytest

from semgs.files.errors import InputError
from semgs.files.folders import MARK, check_folder, own_folder


def tree(folder: Path) -> dict[str, str]:
    return {path.relative_to(folder).as_posix(): path.read_text() for path in folder.rglob("*") if path.is_file()}


def fill(path: Path, text: str, overwrite: bool = False) -> None:
    with own_folder(path, overwrite) as folder:
        (folder / "renders").mkdir()
        (folder / "renders" / "a.txt").write_text(text)


def test_a_new_folder_appears_only_when_it_is_complete(tmp_path: Path) -> None:
    target = tmp_path / "deep" / "er" / "out"
    with own_folder(target) as folder:
        (folder / "a.txt").write_text("a")
        assert not target.exists()
        assert folder.parent == target.parent
    assert (target / "a.txt").read_text() == "a"
    assert (target / MARK).is_file()
    assert list(target.parent.iterdir()) == [target]


def test_an_empty_folder_counts_as_new(tmp_path: Path) -> None:
    (tmp_path / "out").mkdir()
    fill(tmp_path / "out", "a")
    assert (tmp_path / "out" / "renders" / "a.txt").read_text() == "a"
    assert list(tmp_path.iterdir()) == [tmp_path / "out"]


def test_our_own_folder_is_replaced_as_a_whole_and_only_when_told(tmp_path: Path) -> None:
    target = tmp_path / "out"
    fill(target, "old")
    (target / "stale.txt").write_text("of the old run")
    with pytest.raises(InputError, match="--overwrite"):
        fill(target, "new")
    assert (target / "renders" / "a.txt").read_text() == "old"
    fill(target, "new", overwrite=True)
    assert (target / "renders" / "a.txt").read_text() == "new"
    assert not (target / "stale.txt").exists()
    assert list(tmp_path.iterdir()) == [target]


def test_an_old_folder_stays_until_the_new_one_is_complete(tmp_path: Path) -> None:
    target = tmp_path / "out"
    fill(target, "old")
    with own_folder(target, overwrite=True) as folder:
        (folder / "a.txt").write_text("new")
        assert (target / "renders" / "a.txt").read_text() == "old"


@pytest.mark.parametrize(
    "error", [KeyboardInterrupt("stop"), OSError(errno.ENOSPC, "No space left on device"), ValueError("no")]
)
def test_a_failure_leaves_what_was_there_and_nothing_else(tmp_path: Path, error: BaseException) -> None:
    fill(tmp_path / "old", "old")
    before = tree(tmp_path)

    def work(name: str, overwrite: bool) -> None:
        with own_folder(tmp_path / name, overwrite) as folder:
            (folder / "half.txt").write_text("half")
            raise error

    for name, overwrite in (("old", True), ("new", False)):
        with pytest.raises(type(error), match=re.escape(str(error))):
            work(name, overwrite)
    assert tree(tmp_path) == before
    assert sorted(path.name for path in tmp_path.iterdir()) == ["old"]


def test_a_rename_that_fails_brings_the_old_folder_back(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    fill(tmp_path / "out", "old")
    rename = os.replace

    def replace(source: Path, target: Path) -> None:
        if str(source).endswith(".part"):
            raise OSError(errno.ENOSPC, "No space left on device")
        rename(source, target)

    monkeypatch.setattr(os, "replace", replace)
    with pytest.raises(OSError, match="No space left"):
        fill(tmp_path / "out", "new", overwrite=True)
    assert tree(tmp_path)["out/renders/a.txt"] == "old"
    assert [path.name for path in tmp_path.iterdir()] == ["out"]


def test_a_folder_that_is_not_ours_is_never_touched(tmp_path: Path) -> None:
    (tmp_path / "photos").mkdir()
    (tmp_path / "photos" / "holiday.txt").write_text("dear")
    for overwrite in (False, True):
        with pytest.raises(InputError, match="one that semgs wrote, found a folder without the mark"):
            fill(tmp_path / "photos", "new", overwrite)
    assert tree(tmp_path) == {"photos/holiday.txt": "dear"}


def test_a_folder_that_stops_being_free_meanwhile_is_not_touched(tmp_path: Path) -> None:
    target = tmp_path / "out"

    def work(folder: Path) -> None:
        with own_folder(folder):
            target.mkdir()
            (target / "a.txt").write_text("someone else's")

    with pytest.raises(InputError, match="without the mark"):
        work(target)
    assert tree(tmp_path) == {"out/a.txt": "someone else's"}


def test_a_file_or_a_file_above_is_refused(tmp_path: Path) -> None:
    (tmp_path / "file").write_text("a")
    with pytest.raises(InputError, match="found a file"):
        check_folder(tmp_path / "file", overwrite=True)
    with pytest.raises(InputError, match="is a file"):
        check_folder(tmp_path / "file" / "out")
    assert tree(tmp_path) == {"file": "a"}


def test_the_working_folder_and_a_broken_link_are_refused(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    with pytest.raises(InputError, match="the folder you are in"):
        check_folder(".")
    (tmp_path / "link").symlink_to(tmp_path / "nowhere")
    with pytest.raises(InputError, match="leads nowhere"):
        check_folder("link")


def test_a_link_to_one_of_ours_stays_a_link(tmp_path: Path) -> None:
    fill(tmp_path / "real", "old")
    (tmp_path / "link").symlink_to(tmp_path / "real")
    fill(tmp_path / "link", "new", overwrite=True)
    assert (tmp_path / "link").is_symlink()
    assert (tmp_path / "real" / "renders" / "a.txt").read_text() == "new"
