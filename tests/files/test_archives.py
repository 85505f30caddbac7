"""Members of zip archives, read without opening the archive again."""

from __future__ import annotations

import os
import pickle
import struct
import unicodedata
import zipfile
from dataclasses import replace
from pathlib import Path

import pytest
from traced_memory import most_memory

from semgs.files.archives import Archive, Member, members
from semgs.files.errors import InputError
from semgs.files.stored import Stored

TEXTS = {"a/transforms.json": b"{}", "a/images/ä 1.jpg": bytes(range(256)) * 9, "b/empty.png": b""}


@pytest.fixture(params=[zipfile.ZIP_STORED, zipfile.ZIP_DEFLATED])
def archive(request: pytest.FixtureRequest, tmp_path: Path) -> Path:
    """An archive with a folder of its own entry, stored or deflated."""
    path = tmp_path / "my scene.zip"
    with zipfile.ZipFile(path, "w", request.param) as file:
        file.mkdir("a")
        for name, data in TEXTS.items():
            file.writestr(name, data)
    return path


def test_members_hold_what_was_put_in(archive: Path):
    held = members(archive)
    assert {name: member.read_bytes() for name, member in held.items()} == TEXTS
    picture = held["a/images/ä 1.jpg"]
    assert isinstance(picture, Stored)
    assert (picture.name, picture.suffix, str(picture)) == ("ä 1.jpg", ".jpg", f"{archive}/a/images/ä 1.jpg")
    assert pickle.loads(pickle.dumps(picture)) == picture


def test_names_are_found_beside_a_member(archive: Path):
    held = Archive(archive, members(archive))
    start = held.members["a/transforms.json"]
    assert held.beside(start, "images/ä 1.jpg") == held.beside(start, "./images/../images/ä 1.jpg")
    assert held.beside(start, "../b/empty.png") == held.members["b/empty.png"]
    assert held.beside(start, "empty.png") is None


def test_backslashes_of_windows_are_read_as_slashes(tmp_path: Path):
    path = tmp_path / "scene.zip"
    with zipfile.ZipFile(path, "w") as file:
        for name, data in (("a\\transforms.json", b"{}"), ("a\\images\\", b""), ("a\\images\\0.jpg", b"abc")):
            file.writestr(name, data)
    held = Archive(path, members(path))
    assert set(held.members) == {"a/transforms.json", "a/images/0.jpg"}
    picture = held.beside(held.members["a/transforms.json"], "images/0.jpg")
    assert picture is not None
    assert (picture.name, picture.read_bytes()) == ("0.jpg", b"abc")
    with zipfile.ZipFile(path, "a") as file:
        file.writestr("a/images/0.jpg", b"abc")
    with pytest.raises(InputError, match=r"a/images/0\.jpg: expected one member of each name, found 2"):
        members(path)


@pytest.mark.parametrize(("said", "there"), [("NFC", "NFD"), ("NFD", "NFC")])
def test_names_are_found_in_another_form_of_unicode_unless_there_are_several(tmp_path: Path, said: str, there: str):
    path = tmp_path / "scene.zip"
    names = [unicodedata.normalize(there, name) for name in ("a/Küche/é.png", "a/Küche/ä.png")]
    with zipfile.ZipFile(path, "w") as file:
        for name in ("a/transforms.json", *names, "a/\u00ea\u0301.png", "a/e\u0302\u0301.png"):
            file.writestr(name, name)
    held = Archive(path, members(path))
    start = held.members["a/transforms.json"]
    for name in names:
        found = held.beside(start, unicodedata.normalize(said, name).removeprefix("a/"))
        assert found is not None
        assert found.read_bytes() == name.encode()
    assert held.beside(start, "\u1ebf.png") is None
    assert held.beside(start, "e\u0302\u0301.png") == held.members["a/e\u0302\u0301.png"]


def test_damage_is_told_and_not_passed_on(archive: Path):
    held = members(archive)
    picture = held["a/images/ä 1.jpg"]
    data = bytearray(archive.read_bytes())
    data[data.index(b"1.jpg") + 20] ^= 1
    archive.write_bytes(data)
    with pytest.raises(OSError, match="differ from what the archive lists"):
        picture.read_bytes()
    archive.write_bytes(data[: len(data) // 2])
    with pytest.raises(OSError, match="differ from what the archive lists"):
        Member(archive, "x", 10**6, 5, 5, 0).read_bytes()
    with pytest.raises(InputError, match="a zip archive, found one that cannot be read"):
        members(archive)


def patched(path: Path, method: int, flags: int = 0) -> Path:
    """An archive whose headers tell of another compression, or of a password."""
    with zipfile.ZipFile(path, "w", zipfile.ZIP_DEFLATED) as file:
        file.writestr("a", b"a")
    data = bytearray(path.read_bytes())
    for place in (6, data.index(b"PK\1\2") + 8):
        data[place : place + 4] = struct.pack("<2H", flags, method)
    path.write_bytes(data)
    return path


@pytest.mark.parametrize(
    ("method", "flags", "found"),
    [
        (9, 0, "stored or deflated, found one compressed by Deflate64, as Windows Explorer writes for large files"),
        (12, 0, "stored or deflated, found one compressed by bzip2"),
        (14, 0, "stored or deflated, found one compressed by LZMA"),
        (7, 0, "stored or deflated, found one compressed by method 7"),
        (8, 1, "without a password, found one with a password"),
        (99, 1, "without a password, found one with a password"),
    ],
)
def test_other_compressions_and_encryption_are_refused(tmp_path: Path, method: int, flags: int, found: str):
    path = patched(tmp_path / "scene.zip", method, flags)
    with pytest.raises(
        InputError, match=rf"scene\.zip: a: expected members .*{found}; unpack the zip and give the fold"
    ):
        members(path)


def test_an_empty_file_is_no_archive(tmp_path: Path):
    path = tmp_path / "scene.zip"
    path.write_bytes(b"")
    with pytest.raises(InputError, match="a zip archive"):
        members(path)


def test_a_member_is_inflated_to_its_listed_size_and_no_further(tmp_path: Path):
    path = tmp_path / "scene.zip"
    with zipfile.ZipFile(path, "w", zipfile.ZIP_DEFLATED) as file:
        file.writestr("zeros", bytes(10_000_000))
    assert path.stat().st_size < 20_000
    (member,) = members(path).values()
    assert len(member.read_bytes()) == member.size == 10_000_000

    def inflate() -> None:
        with pytest.raises(OSError, match="differ from what the archive lists"):
            replace(member, size=1000).read_bytes()

    assert most_memory(inflate) < 1_000_000
    with pytest.raises(OSError, match=r"3,000,000,000 bytes; at most 268,435,456 are read"):
        replace(member, size=3_000_000_000).read_bytes()


def test_members_longer_than_their_archive_are_refused_before_they_are_read(tmp_path: Path):
    path = tmp_path / "scene.zip"
    with zipfile.ZipFile(path, "w") as file:
        file.writestr("a", b"abc")
    data = bytearray(path.read_bytes())
    listed = data.rindex(b"PK\1\2")
    data[listed + 20 : listed + 28] = struct.pack("<II", 3_000_000_000, 3_000_000_000)
    path.write_bytes(data)
    with pytest.raises(
        InputError, match=r"scene\.zip: a: expected members inside it, found one of 3,000,000,000 bytes"
    ):
        members(path)


def test_two_members_of_one_name_are_refused(tmp_path: Path):
    """The directory lists both; readers of zip archives differ in which one they take."""
    path = tmp_path / "scene.zip"
    with zipfile.ZipFile(path, "w") as file:
        file.writestr("transforms.json", b"{}")
        file.writestr("images/0.png", b"a")
        with pytest.warns(UserWarning, match="Duplicate name"):
            file.writestr("images/0.png", b"b")
    with pytest.raises(InputError, match=r"scene\.zip: images/0\.png: expected one member of each name, found 2"):
        members(path)


def test_a_member_without_a_name_is_refused(tmp_path: Path):
    path = tmp_path / "scene.zip"
    with zipfile.ZipFile(path, "w") as file:
        file.writestr("b", b"abc")
        file.infolist()[0].filename = ""
    with pytest.raises(InputError, match=r"scene\.zip: expected members with names, found one without"):
        members(path)


def test_a_list_of_members_that_is_too_long_is_not_read(tmp_path: Path, monkeypatch: pytest.MonkeyPatch):
    """An entry has 46 bytes and its name, so that of three letters has 49."""
    path = tmp_path / "scene.zip"
    with zipfile.ZipFile(path, "w") as file:
        for number in range(3):
            file.writestr(f"{number:03d}", b"a")
    monkeypatch.setattr("semgs.files.archives.MOST_LISTED", 3 * 49)
    assert len(members(path)) == 3
    monkeypatch.setattr("semgs.files.archives.MOST_LISTED", 3 * 49 - 1)
    os.utime(path, ns=(0, 0))  # else the list is known
    with pytest.raises(InputError, match=r"one that cannot be read: a part of 147 bytes"):
        members(path)


def test_members_with_longer_names_than_files_can_have_are_refused(tmp_path: Path):
    """Digits alone: Python reads no number of more than 4,300, and a capture's frames are named by numbers."""
    path = tmp_path / "a.zip"
    with zipfile.ZipFile(path, "w") as file:
        file.writestr(f"keyframes/images/{'1' * 5000}.jpg", b"x")
    with pytest.raises(InputError, match=r"expected names of at most 4,000 letters, found one of 5,021"):
        members(path)
