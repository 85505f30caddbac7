from __future__ import annotations

import errno
import os
import re
import signal
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path

import pytest
from privileges import permissions_hold

from semgs.files import folders
from semgs.files.errors import InputError
from semgs.files.folders import FILE_ENDINGS, MARK, check_apart, check_folder, check_writable, lock_folder, own_folder


def tree(folder: Path) -> dict[str, str]:
    return {path.relative_to(folder).as_posix(): path.read_text() for path in folder.rglob("*") if path.is_file()}


def fill(path: Path, text: str, overwrite: bool = False) -> None:
    with own_folder(path, "export", overwrite) as folder:
        (folder / "renders").mkdir()
        (folder / "renders" / "a.txt").write_text(text)


def test_a_new_folder_appears_only_when_it_is_complete(tmp_path: Path) -> None:
    target = tmp_path / "deep" / "er" / "out"
    with own_folder(target, "export") as folder:
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


def test_a_folder_of_another_command_is_not_replaced(tmp_path: Path) -> None:
    target = tmp_path / "out"
    fill(target, "old")
    mark = "This folder was written by semgs export. The same command replaces it as a whole if you add --overwrite.\n"
    assert (target / MARK).read_text() == mark
    expected = "expected a new or empty folder, or one that semgs label-splat wrote, found one of semgs export"
    with pytest.raises(InputError, match=expected):
        check_folder(target, "label-splat", overwrite=True)
    with pytest.raises(InputError, match=expected), own_folder(target, "label-splat", overwrite=True):
        pass
    assert (target / "renders" / "a.txt").read_text() == "old"
    # Marks did not always name the command.
    (target / MARK).write_text("This folder was written by semgs, which replaces it as a whole.\n")
    check_folder(target, "label-splat", overwrite=True)


def test_an_old_folder_stays_until_the_new_one_is_complete(tmp_path: Path) -> None:
    target = tmp_path / "out"
    fill(target, "old")
    with own_folder(target, "export", overwrite=True) as folder:
        (folder / "a.txt").write_text("new")
        assert (target / "renders" / "a.txt").read_text() == "old"


@pytest.mark.parametrize(
    "error", [KeyboardInterrupt("stop"), OSError(errno.ENOSPC, "No space left on device"), ValueError("no")]
)
def test_a_failure_leaves_what_was_there_and_nothing_else(tmp_path: Path, error: BaseException) -> None:
    fill(tmp_path / "old", "old")
    before = tree(tmp_path)

    def work(name: str, overwrite: bool) -> None:
        with own_folder(tmp_path / name, "export", overwrite) as folder:
            (folder / "half.txt").write_text("half")
            raise error

    for name, overwrite in (("old", True), ("new", False)):
        with pytest.raises(type(error), match=re.escape(str(error))):
            work(name, overwrite)
    assert tree(tmp_path) == before
    assert sorted(path.name for path in tmp_path.iterdir()) == ["old"]


def test_a_rename_that_fails_brings_the_old_folder_back(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    fill(tmp_path / "out", "old")
    monkeypatch.setattr(folders, "_exchange", lambda first, second: False)
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
        with own_folder(folder, "export"):
            target.mkdir()
            (target / "a.txt").write_text("someone else's")

    with pytest.raises(InputError, match="without the mark"):
        work(target)
    assert tree(tmp_path) == {"out/a.txt": "someone else's"}


def test_a_file_or_a_file_above_is_refused(tmp_path: Path) -> None:
    (tmp_path / "file").write_text("a")
    with pytest.raises(InputError, match="found a file"):
        check_folder(tmp_path / "file", "export", overwrite=True)
    with pytest.raises(InputError, match="is a file"):
        check_folder(tmp_path / "file" / "out", "export")
    assert tree(tmp_path) == {"file": "a"}


def test_the_working_folder_and_a_broken_link_are_refused(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    with pytest.raises(InputError, match="the folder you are in"):
        check_folder(".", "export")
    (tmp_path / "link").symlink_to(tmp_path / "nowhere")
    with pytest.raises(InputError, match="a broken link"):
        check_folder("link", "export")


def test_a_link_to_one_of_ours_stays_a_link(tmp_path: Path) -> None:
    fill(tmp_path / "real", "old")
    (tmp_path / "link").symlink_to(tmp_path / "real")
    fill(tmp_path / "link", "new", overwrite=True)
    assert (tmp_path / "link").is_symlink()
    assert (tmp_path / "real" / "renders" / "a.txt").read_text() == "new"


def test_what_is_read_is_never_replaced_and_a_folder_inside_it_may_be(tmp_path: Path) -> None:
    fill(tmp_path / "room", "old")
    fill(tmp_path / "room" / "out", "old")
    (tmp_path / "link").symlink_to(tmp_path / "room")
    inside = tmp_path / "room" / "renders" / "a.txt"
    for out in (tmp_path / "room", tmp_path / "link"):
        for read in (tmp_path / "room", tmp_path / "link", tmp_path / "room" / "renders" / ".."):
            with pytest.raises(InputError, match="apart from the input, found the input itself"):
                check_folder(out, "export", overwrite=True, inputs=[None, read])
        with pytest.raises(InputError, match=re.escape(f"found one that contains the input {inside}")):
            check_folder(out, "export", overwrite=True, inputs=[str(inside)])
    check_folder(
        tmp_path / "room" / "out", "export", overwrite=True, inputs=[tmp_path / "room", inside, tmp_path / "absent"]
    )
    (tmp_path / "room" / "out" / "linked").symlink_to(tmp_path)  # a name that would go, too
    with pytest.raises(InputError, match="one that contains"):
        check_folder(tmp_path / "room" / "out", "export", overwrite=True, inputs=[tmp_path / "room" / "out" / "linked"])
    with pytest.raises(InputError, match="the input itself"):
        check_apart(inside, [inside])


def test_a_folder_with_the_name_of_a_file_is_refused_and_other_dots_are_not(tmp_path: Path) -> None:
    for name in ("a.ply", "report.JSON", *(f"a{ending}" for ending in FILE_ENDINGS)):
        with pytest.raises(InputError, match=re.escape(f"one that ends with .{name.partition('.')[2]}; leave out")):
            check_folder(tmp_path / name, "export")
    for name in ("office.v2", "2024.05.17", ".hidden", "a.ply.d"):
        check_folder(tmp_path / name, "export")


def test_names_are_exchanged_in_one_step_where_the_system_can(tmp_path: Path) -> None:
    for name in ("a", "b"):
        (tmp_path / name).mkdir()
        (tmp_path / name / name).touch()
    if not folders._exchange(tmp_path / "a", tmp_path / "b"):
        pytest.skip("this system or file system cannot")
    assert sorted(path.relative_to(tmp_path).as_posix() for path in tmp_path.rglob("?")) == ["a", "a/b", "b", "b/a"]
    with pytest.raises(OSError, match="No such file"):
        folders._exchange(tmp_path / "a", tmp_path / "c")


KILLED = """
import os, shutil, signal, sys
from collections.abc import Callable
from pathlib import Path
from semgs.files.folders import own_folder

def killed(*_, **__):
    os.kill(os.getpid(), signal.SIGKILL)

def replaced_then_killed(source, target, replace=Path.replace):
    replace(source, target)
    killed()

with own_folder(sys.argv[1], "export", overwrite=True) as folder:
    (folder / "a.txt").write_text("new")
    Path.replace, shutil.rmtree = replaced_then_killed, killed
"""


def test_a_kill_right_after_the_first_rename_leaves_a_whole_folder_under_the_name(tmp_path: Path) -> None:
    for name in ("a", "b"):
        (tmp_path / name).mkdir()
    if not folders._exchange(tmp_path / "a", tmp_path / "b"):
        pytest.skip("this system or file system cannot exchange names")
    fill(tmp_path / "out", "old")
    done = subprocess.run([sys.executable, "-c", KILLED, str(tmp_path / "out")], check=False)
    assert done.returncode == -signal.SIGKILL
    assert (tmp_path / "out" / "a.txt").read_text() == "new"
    assert (tmp_path / "out" / MARK).is_file()


def test_where_nothing_can_be_written_is_told_before_the_work(tmp_path: Path) -> None:
    (tmp_path / "closed").mkdir(mode=0o500)
    fill(tmp_path / "kept" / "out", "old")
    (tmp_path / "kept").chmod(0o500)
    with permissions_hold():
        for path in (tmp_path / "closed" / "out", tmp_path / "closed" / "deep" / "er", tmp_path / "kept" / "out"):
            with pytest.raises(
                InputError, match=r"a folder that can be created, found Permission denied \(.*(closed|kept)\)$"
            ):
                check_folder(path, "export", overwrite=True)
        with pytest.raises(InputError, match="found Permission denied"):
            check_writable(tmp_path / "closed")
        (tmp_path / "closed").chmod(0o600)
        with pytest.raises(InputError, match="found Permission denied"):  # a folder that may not be entered
            check_folder(tmp_path / "closed" / "out", "export")
        (tmp_path / "closed").chmod(0o700)
    with pytest.raises(InputError, match="found File name too long"):
        check_folder(
            tmp_path / ("n" * 250), "export"
        )  # the name by itself would do, the one beside it is 15 bytes longer
    check_folder(tmp_path / "closed" / "deep" / "er", "export")
    check_writable(tmp_path / "closed" / "deep" / "er")
    assert list((tmp_path / "closed").iterdir()) == []
    assert tree(tmp_path)["kept/out/renders/a.txt"] == "old"


@pytest.mark.skipif(not Path("/proc/self").exists(), reason="a file system of Linux")
def test_a_file_system_that_takes_no_folders_is_told_before_the_work() -> None:
    with pytest.raises(InputError, match=r"found No such file or directory \(/proc\)"):
        check_folder("/proc/out", "export")


def test_a_mount_point_is_told_before_the_work(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    fill(tmp_path / "out", "old")
    monkeypatch.setattr(Path, "is_mount", lambda path: path == tmp_path / "out")
    with pytest.raises(InputError, match="found a mount point; name a folder inside it"):
        check_folder(tmp_path / "out", "export", overwrite=True)
    check_folder(tmp_path / "out" / "inside", "export")


def test_one_process_at_a_time_has_a_folder(tmp_path: Path) -> None:
    (tmp_path / "settings.json").write_text("{}")
    hold = "import sys, pathlib; from semgs.files.folders import lock_folder\nwith lock_folder(pathlib.Path(sys.argv[1]), '', ''): print('held', flush=True); input()"
    with subprocess.Popen(
        [sys.executable, "-c", hold, str(tmp_path)], stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True
    ) as other:
        assert other.stdout is not None
        assert other.stdout.readline() == "held\n"
        with (
            pytest.raises(InputError, match="expected a quiet folder, found a busy one; stop that process first"),
            lock_folder(tmp_path, "a quiet folder", "a busy one"),
        ):
            raise AssertionError("both have it")
        with lock_folder(tmp_path, "", "", name=".lock_1_of_2"):  # another part of its work
            pass
        other.kill()
    with lock_folder(tmp_path, "a quiet folder", "a busy one"):
        assert (tmp_path / "settings.json").read_text() == "{}"
    assert {one.name for one in tmp_path.iterdir()} == {"settings.json", ".lock", ".lock_1_of_2"}


@pytest.mark.parametrize("number", [errno.EAGAIN, errno.EACCES])
def test_a_folder_in_use_is_told_by_either_number_of_the_system(tmp_path: Path, monkeypatch, number: int) -> None:
    """flock on SMB gives EACCES."""
    monkeypatch.setattr("fcntl.flock", _refused(number))
    with (
        pytest.raises(InputError, match="expected a quiet folder, found a busy one"),
        lock_folder(tmp_path, "a quiet folder", "a busy one"),
    ):
        raise AssertionError("both have it")


@pytest.mark.filterwarnings("ignore:flock not supported")
@pytest.mark.parametrize("number", [errno.ENOLCK, errno.ENOTSUP, errno.ENOSYS])
def test_a_file_system_without_locks_stops_nobody(tmp_path: Path, monkeypatch, number: int) -> None:
    monkeypatch.setattr("fcntl.flock", _refused(number))
    for _ in range(2):
        with lock_folder(tmp_path, "a quiet folder", "a busy one"):
            (tmp_path / "written").touch()


@pytest.mark.parametrize("number", [errno.EIO, errno.EPERM, errno.EINVAL, errno.ESTALE])
def test_a_file_system_that_fails_to_lock_is_named(tmp_path: Path, monkeypatch, number: int) -> None:
    monkeypatch.setattr("fcntl.flock", _refused(number))
    with (
        pytest.raises(
            InputError, match=f"{tmp_path.name}: expected a folder that can be locked, found {os.strerror(number)}$"
        ),
        lock_folder(tmp_path, "a quiet folder", "a busy one"),
    ):
        raise AssertionError("it is not locked")


def test_a_folder_below_a_link_that_leads_to_itself_is_one_error(tmp_path: Path) -> None:
    (tmp_path / "loop").symlink_to("loop")
    with (
        pytest.raises(InputError, match="found a link that leads to itself"),
        own_folder(tmp_path / "loop" / "x", "export"),
    ):
        raise AssertionError("there is no such folder")


def test_a_failure_in_a_locked_folder_is_told_as_it_is(tmp_path: Path) -> None:
    with pytest.raises(OSError, match="No space left"), lock_folder(tmp_path, "", ""):
        raise OSError(errno.ENOSPC, "No space left")
    with lock_folder(tmp_path, "", ""):
        pass


def _refused(number: int) -> Callable[..., None]:
    def refused(*given: object) -> None:
        raise OSError(number, os.strerror(number))

    return refused
