from __future__ import annotations

import errno
import json
import os
import signal
from pathlib import Path

import pytest
from privileges import permissions_hold

from semgs.files.atomic import check_file, remove_parts, write_bytes, write_json, write_text
from semgs.files.errors import InputError


def full_disk(*_: object, **__: object) -> None:
    raise OSError(errno.ENOSPC, "No space left on device")


def test_what_is_written_is_read_back(tmp_path: Path) -> None:
    write_bytes(tmp_path / "a.bin", b"\x00\xff\n")
    write_text(tmp_path / "b.txt", "grün\n")
    write_json(tmp_path / "c.json", {"psnr": 22.5, "names": ["ä"], "none": None}, durable=True)
    assert (tmp_path / "a.bin").read_bytes() == b"\x00\xff\n"
    assert (tmp_path / "b.txt").read_bytes() == "grün\n".encode()
    assert json.loads((tmp_path / "c.json").read_text(encoding="utf-8")) == {
        "psnr": 22.5,
        "names": ["ä"],
        "none": None,
    }
    assert sorted(path.name for path in tmp_path.iterdir()) == ["a.bin", "b.txt", "c.json"]


def test_a_second_writing_replaces_the_first(tmp_path: Path) -> None:
    write_text(tmp_path / "a.txt", "a long first text")
    write_text(tmp_path / "a.txt", "short")
    assert (tmp_path / "a.txt").read_text() == "short"


@pytest.mark.parametrize("durable", [False, True])
def test_a_full_disk_leaves_the_old_file_and_nothing_else(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, durable: bool
) -> None:
    write_text(tmp_path / "a.txt", "old")
    monkeypatch.setattr(os, "fsync" if durable else "replace", full_disk)
    with pytest.raises(OSError, match="No space left"):
        write_text(tmp_path / "a.txt", "new", durable=durable)
    assert (tmp_path / "a.txt").read_text() == "old"
    assert [path.name for path in tmp_path.iterdir()] == ["a.txt"]


def test_a_disk_that_fills_up_in_the_middle_of_a_file_leaves_no_part_of_it(tmp_path: Path) -> None:
    resource = pytest.importorskip("resource")
    soft, hard = resource.getrlimit(resource.RLIMIT_FSIZE)
    old = signal.signal(signal.SIGXFSZ, signal.SIG_IGN)
    resource.setrlimit(resource.RLIMIT_FSIZE, (1000, hard))
    try:
        with pytest.raises(OSError, match="File too large"):
            write_bytes(tmp_path / "a.bin", b"x" * 4000)
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, (soft, hard))
        signal.signal(signal.SIGXFSZ, old)
    assert list(tmp_path.iterdir()) == []


def test_numbers_that_json_cannot_say_are_refused_before_anything_is_written(tmp_path: Path) -> None:
    with pytest.raises(ValueError, match="expected finite numbers"):
        write_json(tmp_path / "a.json", {"psnr": float("nan")})
    assert list(tmp_path.iterdir()) == []


def test_a_new_file_has_the_rights_of_any_other(tmp_path: Path) -> None:
    write_text(tmp_path / "ours", "a")
    (tmp_path / "plain").write_text("a")
    assert (tmp_path / "ours").stat().st_mode == (tmp_path / "plain").stat().st_mode


def test_names_that_are_no_utf8_come_back_from_json_as_they_were(tmp_path: Path) -> None:
    name = os.fsdecode(b"caf\xe9.png")
    write_json(tmp_path / "a.json", {"frame": name})
    assert b'"caf\\udce9.png"' in (tmp_path / "a.json").read_bytes()
    assert json.loads((tmp_path / "a.json").read_text())["frame"] == name


def test_a_file_that_can_be_written_is_told_from_one_that_cannot_and_nothing_is_left(tmp_path: Path) -> None:
    (tmp_path / "closed").mkdir(mode=0o500)
    (tmp_path / "old").write_text("old")
    check_file(tmp_path / "new")
    check_file(tmp_path / "old")
    with permissions_hold():
        for name, found in {
            "closed/new": "Permission denied",
            "nowhere/new": "no such folder",
            "closed": "a folder",
            "n" * 250: "File name too long",  # fits by itself, but not with what is put beside it until it is complete
        }.items():
            with pytest.raises(InputError, match=f"found {found}"):
                check_file(tmp_path / name)
    assert sorted(path.name for path in tmp_path.rglob("*")) == ["closed", "old"]
    assert (tmp_path / "old").read_text() == "old"


def test_parts_that_killed_processes_left_are_removed_but_those_of_the_record_and_everything_else_stay(
    tmp_path: Path,
) -> None:
    stay = {"a.zip", "settings.json", ".settings.json.0123abcd.part", ".hidden", "own.part", ".folder.0123abcd.part"}
    for name in (stay - {".folder.0123abcd.part"}) | {".a.zip.0123abcd.part", ".index.json.89abcdef.part"}:
        (tmp_path / name).touch()
    (tmp_path / ".folder.0123abcd.part").mkdir()
    remove_parts(tmp_path, tmp_path / "settings.json")
    assert {path.name for path in tmp_path.iterdir()} == stay
