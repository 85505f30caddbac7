"""Compressed bags are inflated up to a limit, whatever they say."""

from __future__ import annotations

import bz2
import sqlite3
from contextlib import closing
from pathlib import Path

import lz4.frame
import pytest

from semgs.data.layouts.ros.bag import Bag
from semgs.files import bags
from semgs.files.bags import inflate
from semgs.files.errors import InputError

pytest.importorskip("rosbags")

LZ4 = (lz4.frame.compress, lz4.frame.LZ4FrameDecompressor)
BZ2 = (bz2.compress, bz2.BZ2Decompressor)


@pytest.mark.parametrize(("compress", "decompressor"), [LZ4, BZ2], ids=["lz4", "bz2"])
def test_streams_become_what_they_were_up_to_the_limit(monkeypatch: pytest.MonkeyPatch, compress, decompressor):
    monkeypatch.setattr(bags, "MOST_CHUNK", 5000)
    first, second = b"ab" * 1000, bytes(3000)
    assert inflate(compress(first), decompressor) == first
    assert inflate(compress(first) + compress(second), decompressor) == first + second
    assert inflate(b"", decompressor) == b""
    for longer in (compress(bytes(5001)), compress(bytes(10_000_000)), compress(first) + compress(bytes(3001))):
        with pytest.raises(ValueError, match="a compressed part of more than 5,000 bytes"):
            inflate(longer, decompressor)
    with pytest.raises(ValueError, match="ends early"):
        inflate(compress(first)[:-9], decompressor)


def write_bag(path: Path, length: int, storage: str, compression: str) -> Path:
    """Write a bag with one text of so many letters a, compressed in one of rosbags' ways."""
    from rosbags.rosbag1 import Writer as Writer1
    from rosbags.rosbag2 import CompressionFormat, CompressionMode, StoragePlugin
    from rosbags.rosbag2 import Writer as Writer2
    from rosbags.typesys import Stores, get_typestore

    store = get_typestore(Stores.ROS1_NOETIC if storage == "ros1" else Stores.ROS2_HUMBLE)
    text = store.types["std_msgs/msg/String"]("a" * length)
    if storage == "ros1":
        writer = Writer1(path.with_suffix(".bag"))
        writer.set_compression(Writer1.CompressionFormat[compression])
    else:
        writer = Writer2(path, version=8, storage_plugin=StoragePlugin[storage])
        writer.set_compression(CompressionMode[compression], CompressionFormat.ZSTD)
    with writer:
        connection = writer.add_connection("/words", "std_msgs/msg/String", typestore=store)
        data = (
            store.serialize_ros1(text, text.__msgtype__)
            if storage == "ros1"
            else store.serialize_cdr(text, text.__msgtype__)
        )
        writer.write(connection, 1, data)
    return path.with_suffix(".bag") if storage == "ros1" else path


@pytest.mark.parametrize(
    ("storage", "compression"),
    [
        ("ros1", "BZ2"), ("ros1", "LZ4"), ("MCAP", "STORAGE"), ("MCAP", "MESSAGE"), ("SQLITE3", "MESSAGE"), ("SQLITE3", "FILE"),
    ],
)  # fmt: skip
def test_bags_are_read_up_to_the_limit(tmp_path: Path, monkeypatch: pytest.MonkeyPatch, storage: str, compression: str):
    monkeypatch.setattr(bags, "MOST_CHUNK", 200_000)
    monkeypatch.setattr(bags, "MOST_GROWTH", 1)
    short = write_bag(tmp_path / "short", 100_000, storage, compression)
    assert len(next(iter(Bag(short).messages(["/words"])))[1].data) == 100_000
    long = write_bag(tmp_path / "long", 900_000, storage, compression)
    with pytest.raises(InputError, match=r"a compressed (part|bag)"):
        list(Bag(long).messages(["/words"]))


@pytest.mark.parametrize("name", ["%2e%2e%2fsecret%2fa.db3", "..%2fsecret%2fa.db3"])
def test_the_name_of_a_database_is_no_address_that_leads_elsewhere(tmp_path: Path, name: str):
    secret = write_bag(tmp_path / "secret", 50, "SQLITE3", "NONE")
    (database,) = secret.glob("*.db3")
    about = (secret / "metadata.yaml").read_text()
    (tmp_path / "asked").mkdir()
    (tmp_path / "asked" / "metadata.yaml").write_text(about.replace(database.name, name))
    (tmp_path / "asked" / name).touch()
    database.rename(secret / "a.db3")
    with pytest.raises(InputError):
        list(Bag(tmp_path / "asked").messages(["/words"]))


def test_signs_of_addresses_in_the_name_of_a_folder_are_only_letters(tmp_path: Path):
    path = write_bag(tmp_path / "a", 50, "SQLITE3", "NONE").rename(tmp_path / "a #1?%41")
    assert len(next(iter(Bag(path).messages(["/words"])))[1].data) == 50


def test_a_list_of_topics_that_multiplies_itself_is_refused_before_it_is_read(tmp_path: Path):
    """Nine lines of ten aliases each stand for a thousand million words."""
    bag = write_bag(tmp_path / "a", 50, "SQLITE3", "NONE")
    about = bag / "metadata.yaml"
    text = about.read_text()
    lines = [
        f"a{level}: &a{level} [{', '.join([f'*a{level - 1}'] * 10 if level else ['ha'] * 10)}]" for level in range(9)
    ]
    about.write_text("\n".join([*lines, text]))
    with pytest.raises(InputError, match="repeats parts of itself"):
        Bag(bag)
    about.write_text(text + "# " + "a" * (1 << 20))
    with pytest.raises(InputError, match=r"metadata\.yaml has more than 1,048,576 bytes"):
        Bag(bag)
    about.write_text(text)
    assert len(next(iter(Bag(bag).messages(["/words"])))[1].data) == 50


def test_a_database_with_a_view_in_place_of_its_messages_is_refused(tmp_path: Path):
    """A view can compute for ever; SQLite would run it for each question of the reader."""
    bag = write_bag(tmp_path / "a", 50, "SQLITE3", "NONE")
    (file,) = bag.glob("*.db3")
    with closing(sqlite3.connect(file)) as database:
        database.execute("ALTER TABLE messages RENAME TO kept")
        database.execute(
            "CREATE VIEW messages AS WITH RECURSIVE n(i) AS (SELECT 1 UNION ALL SELECT i + 1 FROM n) SELECT kept.* FROM kept, n"
        )
        database.commit()
    with pytest.raises(InputError):
        list(Bag(bag).messages(["/words"]))


def bag_of(path: Path, definition: str) -> Path:
    """A bag of ROS 1 with a message of a type that it defines itself; the data are not looked at."""
    from rosbags.rosbag1 import Writer
    from rosbags.typesys import Stores, get_types_from_msg, get_typestore

    store = get_typestore(Stores.ROS1_NOETIC)
    store.register(get_types_from_msg(definition, "own/msg/Own"))
    md5sum = store.generate_msgdef("own/msg/Own", ros_version=1)[1]
    file = path.with_suffix(".bag")
    with Writer(file) as writer:
        connection = writer.add_connection("/own", "own/msg/Own", msgdef=definition, md5sum=md5sum)
        writer.write(connection, 1, bytes(64))
    return file


@pytest.mark.parametrize(
    ("definition", "message"),
    [
        ("string[1025] a", r"1,025 elements in own/msg/Own\.a"), ("string[2000000000] a", r"2,000,000,000 elements"),
        ("float64[67108865] a", r"67,108,865 elements"), ("uint8 a # " + "a" * (1 << 18), "a definition of more than 262,144 characters"),
    ],
)  # fmt: skip
def test_definitions_for_which_code_without_end_would_be_written_are_refused(
    tmp_path: Path, definition: str, message: str
):
    with pytest.raises(InputError, match=message):
        Bag(bag_of(tmp_path / "a", definition))


def test_honest_arrays_of_a_fixed_length_are_read(tmp_path: Path):
    assert Bag(bag_of(tmp_path / "a", "string[1024] a\nfloat64[36] b")).topics == {"/own": "own/msg/Own"}


@pytest.mark.parametrize(
    "line",
    [
        "const long A = ((1));",
        "const long A = (1);",
        "const long A = 1 << 80000000;",
        "@a(value=((1))) struct B { long c; };",
    ],
)
def test_definitions_in_idl_that_take_for_ever_are_refused(line: str):
    from rosbags.highlevel import anyreader

    bags._bound_rosbags()
    text = "module own { module msg { %s struct Own { long a; }; }; };"
    with pytest.raises(ValueError, match="computed constants or nested parentheses"):
        anyreader.get_types_from_idl(text % line)
    honest = text % '@verbatim (language="comment", text="a (b (c)) const (d)") // const (e)\n'
    assert "own/msg/Own" in anyreader.get_types_from_idl(honest)
