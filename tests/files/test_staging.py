"""What a killed process left under a temporary name is removed by the next one, and nothing else is."""

from __future__ import annotations

import errno
import os
import signal
import subprocess
import sys
from pathlib import Path

import pytest

from semgs.files import folders
from semgs.files.errors import InputError
from semgs.files.folders import MARK, check_folder, own_folder, remove_left, staged

FILLS = """
import os, signal, sys
from pathlib import Path
from semgs.files.folders import own_folder
from semgs.files.folders import staged

with own_folder(sys.argv[1], "export") as folder, staged(Path(sys.argv[2])) as file:
    (folder / "a.txt").write_text("half")
    file.write_text("half")
    print("ready", flush=True)
    sys.stdin.read()
    os.kill(os.getpid(), signal.SIGKILL)
"""


def names(folder: Path) -> list[str]:
    return sorted(path.name for path in folder.iterdir())


def test_what_a_process_writes_stays_while_it_lives_and_is_removed_once_it_was_killed(tmp_path: Path):
    out, file = tmp_path / "out", tmp_path / "walk.mp4"
    with subprocess.Popen(
        [sys.executable, "-c", FILLS, str(out), str(file)], stdin=subprocess.PIPE, stdout=subprocess.PIPE
    ) as process:
        assert process.stdout is not None
        process.stdout.readline()
        there = names(tmp_path)
        assert [name.split(".")[1] + name[-5:] for name in there] == ["out.lock", "out.part", "walk.lock", "walk.part"]
        check_folder(out, "export")
        remove_left(file)
        with own_folder(out, "export") as folder:
            (folder / "b.txt").write_text("whole")
        assert names(tmp_path) == sorted([*there, "out"])
        assert names(out) == [MARK, "b.txt"]
    assert process.returncode == -signal.SIGKILL
    assert names(tmp_path) == sorted([*there, "out"])
    check_folder(out, "export", overwrite=True)
    assert names(tmp_path) == [*there[2:], "out"]
    with staged(file) as partial:
        partial.write_text("whole")
        partial.replace(file)
    assert names(tmp_path) == ["out", "walk.mp4"]


@pytest.mark.parametrize(
    "other",
    [
        ".out.1a2b3c4d.part",  # a folder of the user, or of an earlier version, of which nobody knows whether it is in use
        ".outer.1a2b3c4d.part",
        ".out.1a2b3c4d.part.lock",
        ".out.1a2b3c4.lock",
        ".out.notahash.lock",
        "out.1a2b3c4d.lock",
        ".out.1a2b3c4d.old",
    ],
)
def test_what_is_not_surely_ours_stays(tmp_path: Path, other: str):
    (tmp_path / other).mkdir()
    (tmp_path / other / "a.txt").write_text("of a user")
    with own_folder(tmp_path / "out", "export"):
        pass
    assert names(tmp_path) == sorted([other, "out"])
    assert (tmp_path / other / "a.txt").exists()


def test_a_link_under_such_a_name_is_removed_but_not_what_it_points_to(tmp_path: Path):
    (tmp_path / "kept").mkdir()
    (tmp_path / "kept/a.txt").touch()
    (tmp_path / ".out.1a2b3c4d.part").symlink_to(tmp_path / "kept")
    (tmp_path / ".out.1a2b3c4d.lock").touch()
    remove_left(tmp_path / "out")
    assert names(tmp_path) == ["kept"]
    assert names(tmp_path / "kept") == ["a.txt"]


def test_names_with_special_letters_are_not_patterns(tmp_path: Path):
    (tmp_path / ".oat.1a2b3c4d.lock").touch()
    (tmp_path / ".o*t.1a2b3c4d.lock").touch()
    remove_left(tmp_path / "o.t")
    remove_left(tmp_path / "o*t")
    assert names(tmp_path) == [".oat.1a2b3c4d.lock"]


def test_a_failed_block_leaves_nothing(tmp_path: Path):
    def fail(folder: bool) -> None:
        with staged(tmp_path / "out") as partial:
            if folder:
                partial.mkdir()
            (partial / "a.txt" if folder else partial).touch()
            raise KeyboardInterrupt

    for folder in (False, True):
        with pytest.raises(KeyboardInterrupt):
            fail(folder)
        assert names(tmp_path) == []


def test_a_name_that_another_process_took_for_a_left_one_is_not_used(tmp_path: Path, monkeypatch: pytest.MonkeyPatch):
    """Between the creation of a lock file and its lock, another process may find and remove it."""
    chosen = iter([tmp_path / ".out.00000001.part", tmp_path / ".out.00000002.part"])
    monkeypatch.setattr(folders, "partial_name", lambda target: next(chosen))

    class Overtaken(folders.FileLock):  # type: ignore[misc, valid-type]
        def acquire(self, **options: float) -> object:
            held = super().acquire(**options)
            if "00000001" in self.lock_file:
                Path(self.lock_file).unlink()
            return held

    monkeypatch.setattr(folders, "FileLock", Overtaken)
    with staged(tmp_path / "out") as partial:
        assert partial.name == ".out.00000002.part"
        assert names(tmp_path) == [".out.00000002.lock"]
    assert names(tmp_path) == []


def test_without_locks_outputs_are_written_and_nothing_is_removed(tmp_path: Path, monkeypatch: pytest.MonkeyPatch):
    def refuse(self: object, **_: object) -> None:
        raise NotImplementedError

    (tmp_path / ".out.1a2b3c4d.part").mkdir()
    (tmp_path / ".out.1a2b3c4d.lock").touch()
    monkeypatch.setattr(folders.FileLock, "acquire", refuse)
    with own_folder(tmp_path / "out", "export"):
        assert len(names(tmp_path)) == 3
    assert names(tmp_path) == [".out.1a2b3c4d.lock", ".out.1a2b3c4d.part", "out"]


@pytest.mark.filterwarnings("ignore:flock not supported")
@pytest.mark.parametrize("number", [errno.ENOLCK, errno.ENOTSUP, errno.ENOSYS])
def test_without_locks_a_file_gets_one_temporary_name_and_nothing_stays(tmp_path: Path, monkeypatch, number: int):
    """ENOSYS is what Lustre says; a marker that was there before made us try names without end."""

    def refused(*given: object) -> None:
        raise OSError(number, os.strerror(number))

    monkeypatch.setattr("fcntl.flock", refused)
    tried = []
    named = folders.partial_name
    monkeypatch.setattr(folders, "partial_name", lambda target: tried.append(target) or named(target))
    with staged(tmp_path / "a.txt") as partial:
        partial.write_text("whole")
        partial.replace(tmp_path / "a.txt")
    assert len(tried) == 1
    assert names(tmp_path) == ["a.txt"]


def test_another_process_may_clean_up_while_a_name_is_being_locked(tmp_path: Path, monkeypatch: pytest.MonkeyPatch):
    touch = Path.touch
    touched = []

    def touch_then_clean(path: Path, mode: int = 0o666, exist_ok: bool = True) -> None:
        touch(path, mode, exist_ok)
        touched.append(path)
        remove_left(
            tmp_path / "out"
        )  # nothing has been locked yet, so a lock would be taken for that of a killed process
        assert path.exists()

    monkeypatch.setattr(Path, "touch", touch_then_clean)
    with own_folder(tmp_path / "out", "export") as folder:
        (folder / "a.txt").write_text("whole")
    assert len(touched) == 1
    assert names(tmp_path) == ["out"]
    assert names(tmp_path / "out") == [MARK, "a.txt"]


@pytest.mark.parametrize("overwrite", [False, True])
def test_another_process_may_finish_the_same_folder_just_before(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, overwrite: bool
):
    swap = folders._swap
    tries = []

    def swap_second(staging: Path, target: Path) -> None:
        tries.append(staging)
        if len(tries) == 1:
            with monkeypatch.context() as quiet:
                quiet.setattr(folders, "_swap", swap)
                with own_folder(target, "export") as first:
                    (first / "a.txt").write_text("first")
            staging.replace(target)  # as after finding that it did not exist
        swap(staging, target)

    monkeypatch.setattr(folders, "_swap", swap_second)

    def write() -> None:
        with own_folder(tmp_path / "out", "export", overwrite) as second:
            (second / "a.txt").write_text("second")

    if overwrite:
        write()
    else:
        with pytest.raises(InputError, match="expected a new folder, found one that semgs wrote before"):
            write()
    assert len(tries) == 1 + overwrite
    assert names(tmp_path) == ["out"]
    assert (tmp_path / "out" / "a.txt").read_text() == ("second" if overwrite else "first")
