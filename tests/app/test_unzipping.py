"""Zips that are made to take memory, disk or files: each is refused with a sentence, and nothing of the member that failed stays."""

from __future__ import annotations

import struct
import tracemalloc
import warnings
import zipfile
import zlib
from collections.abc import Callable
from pathlib import Path

import pytest

from semgs.app.limits import Limits
from semgs.app.unzipping import DEEPEST, LONGEST_NAME, PIECE, UnfitZipError, unpack_zip
from semgs.files.archives import BoundedFile, LongReadError

SMALL = Limits(members=5, unpacked_bytes=100_000)


def zip_of(path: Path, *members: tuple[str, bytes], method: int = zipfile.ZIP_DEFLATED) -> None:
    """Write a zip; names may be the same."""
    with warnings.catch_warnings(), zipfile.ZipFile(path, "w", method) as archive:
        warnings.simplefilter("ignore")
        for name, data in members:
            archive.writestr(name, data)


def long_list(path: Path, entries: int) -> None:
    """Write a zip whose list has an entry of 46 bytes many times, all without a name and of the same 3 bytes; its end says that there is one."""
    local = b"PK\3\4" + struct.pack("<5H3I2H", 20, 0, 0, 0, 0, zlib.crc32(b"abc"), 3, 3, 1, 0) + b"a" + b"abc"
    entry = b"PK\1\2" + struct.pack("<6H3I5H2I", 20, 20, 0, 0, 0, 0, zlib.crc32(b"abc"), 3, 3, 0, 0, 0, 0, 0, 0, 0)
    end = b"PK\5\6" + struct.pack("<4H2IH", 0, 0, 1, 1, entries * len(entry), len(local), 0)
    path.write_bytes(local + entries * entry + end)


def overlapping(path: Path) -> None:
    """Write a zip in which the first of two stored members spans the second with its header, so the bytes of the second count twice."""
    zip_of(path, ("a", b"1"), ("b", b"2" * 50), method=zipfile.ZIP_STORED)
    data = bytearray(path.read_bytes())
    at = data.index(b"PK\1\2")
    spanned = data[31 : 31 + 60]
    data[at + 16 : at + 28] = struct.pack("<3I", zlib.crc32(spanned), 60, 60)
    path.write_bytes(data)


def two_at_one_place(path: Path) -> None:
    """Write a zip whose two members are the same bytes."""
    zip_of(path, ("a", b"1" * 50), ("b", b"2" * 50))
    data = bytearray(path.read_bytes())
    second = data.index(b"PK\1\2", data.index(b"PK\1\2") + 4)
    data[second + 42 : second + 46] = bytes(4)
    path.write_bytes(data)


UNFIT: dict[str, tuple[Callable[[Path], None], str]] = {
    "bzip2": (lambda path: zip_of(path, ("a", b"x" * 90), method=zipfile.ZIP_BZIP2), "compressed by bzip2, which"),
    "LZMA": (lambda path: zip_of(path, ("a", b"x" * 90), method=zipfile.ZIP_LZMA), "compressed by LZMA, which"),
    "a list of 100,000 entries that says one": (lambda path: long_list(path, 100_000), "contains too many files; at most 5"),
    "six files": (lambda path: zip_of(path, *((str(n), b"") for n in range(6))), "contains 6 files"),
    "two of one name": (lambda path: zip_of(path, ("a", b"x"), ("a", b"y")), "two files of the same name"),
    "two spellings of one name": (lambda path: zip_of(path, ("b/a", b"x"), ("b/./a", b"y")), "two files of the same name"),
    "a file that is a folder": (lambda path: zip_of(path, ("a/b", b"x"), ("a", b"y")), "a file and a folder of the same name"),
    "two spellings of one name, with a backslash": (lambda path: zip_of(path, ("b/a", b"x"), ("b\\a", b"y")), "two files of the same name"),
    "a file that is a folder, with a backslash": (lambda path: zip_of(path, ("a\\b", b"x"), ("a", b"y")), "a file and a folder of the same name"),
    "a deep path with backslashes": (lambda path: zip_of(path, (DEEPEST * "a\\" + "b", b"x")), "more than 32 folders"),
    **{
        f"outside, as {name}": (lambda path, name=name: zip_of(path, ("a", b"x"), (name, b"y")), "leads outside of it")
        for name in ("..\\x", "a\\..\\..\\x", "a/..\\x", "\\x", "\\\\server\\share\\x", "C:\\x", "C:x", ".\\..\\x")
    },
    "a long name": (lambda path: zip_of(path, ((LONGEST_NAME + 1) * "a", b"x")), "a name that is too long"),
    "a long name of few letters": (lambda path: zip_of(path, (81 * "€", b"x")), "a name that is too long"),
    "a long path": (lambda path: zip_of(path, ("/".join(9 * [120 * "a"]), b"x")), "a name that is too long"),
    "a deep path": (lambda path: zip_of(path, (DEEPEST * "a/" + "b", b"x")), "more than 32 folders"),
    "many folders": (lambda path: zip_of(path, ("a/b/c/d/e/f/g", b"x")), "contains 6 folders; at most 5"),
    "one member inside another": (overlapping, "overlap"),
    "two members at one place": (two_at_one_place, "overlap"),
    "100,001 bytes": (lambda path: zip_of(path, ("a", bytes(50_000)), ("b", bytes(50_001))), "would unpack to"),
}  # fmt: skip
"""Zips by what is wrong with them, and the sentence."""


@pytest.mark.parametrize("name", UNFIT)
def test_an_unfit_zip_gets_a_sentence_before_anything_is_written(tmp_path: Path, name: str):
    make, expected = UNFIT[name]
    make(tmp_path / "a.zip")
    (tmp_path / "out").mkdir()
    with pytest.raises(UnfitZipError, match=expected) as raised:
        unpack_zip(tmp_path / "a.zip", tmp_path / "out", SMALL)
    assert str(raised.value).endswith(".")
    assert list((tmp_path / "out").iterdir()) == []


@pytest.mark.parametrize("method", [zipfile.ZIP_STORED, zipfile.ZIP_DEFLATED])
@pytest.mark.parametrize("length", [0, 1, PIECE - 1, PIECE, PIECE + 1, 2 * PIECE + 7])
def test_members_of_any_length_come_out_whole(tmp_path: Path, method: int, length: int):
    content = bytes(range(256)) * (length // 256) + bytes(range(length % 256))
    zip_of(tmp_path / "a.zip", ("room/a", content), (LONGEST_NAME * "b", b"x"), method=method)
    (tmp_path / "out").mkdir()
    unpack_zip(tmp_path / "a.zip", tmp_path / "out", Limits())
    assert (tmp_path / "out/room/a").read_bytes() == content
    assert (tmp_path / "out" / (LONGEST_NAME * "b")).read_bytes() == b"x"


def test_backslashes_of_windows_separate_folders(tmp_path: Path):
    zip_of(
        tmp_path / "a.zip",
        ("images\\", b""),
        ("images\\0.jpg", b"x"),
        ("images\\near/1.jpg", b"y"),
        ("__MACOSX\\a", b"z"),
        ("images\\._0.jpg", b"z"),
    )
    (tmp_path / "out").mkdir()
    unpack_zip(tmp_path / "a.zip", tmp_path / "out", Limits())
    files = {
        str(one.relative_to(tmp_path / "out")): one.read_bytes()
        for one in (tmp_path / "out").rglob("*")
        if one.is_file()
    }
    assert files == {"images/0.jpg": b"x", "images/near/1.jpg": b"y"}


@pytest.mark.parametrize("deflated", [False, True])
def test_a_damaged_member_leaves_no_file_but_those_before_it_stay(tmp_path: Path, deflated: bool):
    content = bytes(range(256)) * 20
    zip_of(tmp_path / "a.zip", ("a", b"good"), ("b", content), method=8 if deflated else 0)
    data = bytearray((tmp_path / "a.zip").read_bytes())
    data[data.index(b"PK\3\4", 4) + 31 + 40] ^= 1  # in the content of b
    (tmp_path / "a.zip").write_bytes(data)
    (tmp_path / "out").mkdir()
    with pytest.raises((zipfile.BadZipFile, zlib.error)):
        unpack_zip(tmp_path / "a.zip", tmp_path / "out", Limits())
    assert [path.name for path in (tmp_path / "out").iterdir()] == ["a"]


def test_a_member_that_is_longer_than_listed_leaves_no_file(tmp_path: Path):
    zip_of(tmp_path / "a.zip", ("a", bytes(5000)))
    data = bytearray((tmp_path / "a.zip").read_bytes())
    at = data.index(b"PK\1\2")
    data[at + 16 : at + 20] = struct.pack("<I", zlib.crc32(bytes(100)))
    data[at + 24 : at + 28] = struct.pack("<I", 6000)
    (tmp_path / "a.zip").write_bytes(data)
    (tmp_path / "out").mkdir()
    with pytest.raises((UnfitZipError, zipfile.BadZipFile)):
        unpack_zip(tmp_path / "a.zip", tmp_path / "out", Limits())
    assert list((tmp_path / "out").iterdir()) == []


def test_a_member_of_64_mb_of_zeros_takes_a_few_pieces_of_memory(tmp_path: Path):
    with zipfile.ZipFile(tmp_path / "a.zip", "w", zipfile.ZIP_DEFLATED) as archive, archive.open("a", "w") as member:
        for _ in range(64):
            member.write(bytes(PIECE))
    (tmp_path / "out").mkdir()
    tracemalloc.start()
    try:
        unpack_zip(tmp_path / "a.zip", tmp_path / "out", Limits())
        peak = tracemalloc.get_traced_memory()[1]
    finally:
        tracemalloc.stop()
    assert (tmp_path / "out/a").stat().st_size == 64 * PIECE
    assert peak < 6 * PIECE


def test_a_bounded_file_refuses_longer_reads(tmp_path: Path):
    (tmp_path / "a").write_bytes(b"12345678")
    with BoundedFile(tmp_path / "a", 4) as file:
        assert file.read(4) == b"1234"
        assert file.read() == b"5678"
        for size in (5, -1, None):
            file.seek(0)
            with pytest.raises(LongReadError):
                file.read(size)
