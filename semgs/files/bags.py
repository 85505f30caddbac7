"""ROS bags by the library rosbags (extra `ros`); ROS is not needed."""

from __future__ import annotations

import bz2
import os
import re
from collections.abc import Callable, Sequence
from functools import cache, wraps
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any, BinaryIO
from urllib.parse import quote

from semgs.files.errors import needs_extra

MOST_CHUNK = 1 << 28
"""Longest chunk or message that is inflated [bytes]: 256 MiB. Recorders make chunks of a megabyte, or of one large image."""

MOST_GROWTH = 100
"""A bag that is compressed as a whole may become so many times longer, beside `MOST_CHUNK`."""

MOST_DEFINITION, MOST_ELEMENTS, MOST_NUMBERS = 1 << 18, 1 << 10, 1 << 26
"""Characters of the definition of a message; elements of an array of fixed length in it, and of one of numbers."""

METADATA, MOST_METADATA = "metadata.yaml", 1 << 20
"""The list of a bag's topics, and its largest size [bytes]."""

MCAP_ENCODINGS = ("protobuf", "json", "flatbuffer", "cdr")
"""How messages in MCAP files are encoded; cdr is that of ROS 2."""

MOST_MCAP_HEADER, MOST_MCAP_SUMMARY = 1 << 12, 1 << 20
"""Bytes of an MCAP file in which its profile is, and those at its end in which encodings are looked for."""

VISION = {
    "BoundingBox3D": "geometry_msgs/Pose center\ngeometry_msgs/Vector3 size",
    "Detection3D": "std_msgs/Header header\nObjectHypothesisWithPose[] results\nBoundingBox3D bbox\nstring id",
    "Detection3DArray": "std_msgs/Header header\nDetection3D[] detections",
    "LabelInfo": "std_msgs/Header header\nVisionClass[] class_map\nfloat32 threshold",
    "ObjectHypothesis": "string class_id\nfloat64 score",
    "ObjectHypothesisWithPose": "ObjectHypothesis hypothesis\ngeometry_msgs/PoseWithCovariance pose",
    "VisionClass": "uint16 class_id\nstring class_name",
}
"""Definitions of vision_msgs 4 (https://github.com/ros-perception/vision_msgs, branch ros2), which rosbags does not have."""


def bag_reader(path: Path, recordings: Sequence[Path] = ()) -> Any:
    """rosbags' reader of a bag, or of its recordings, not yet opened. Messages without types have those of the newest ROS 2.

    Raises:
        ImportError: rosbags is not installed.
        ValueError: its list of topics is not one that a recorder writes.
    """
    with needs_extra("ros", f"{path} is a ROS bag; reading it needs rosbags", "rosbags"):
        from rosbags.highlevel import AnyReader
        from rosbags.typesys import Stores, get_typestore
    _bound_rosbags()
    _check_metadata(path / METADATA)
    return AnyReader(recordings or [path], default_typestore=get_typestore(Stores.LATEST))


def foreign_mcap(path: Path) -> tuple[str, str] | None:
    """What an MCAP file is if not a recording of ROS 2, and what to do; None if it is one, or not an intact MCAP file.

    Its first record has the profile. Its summary, at the end, has the encodings of the messages. Source: https://mcap.dev/spec
    """
    if not path.is_file():
        return None
    with path.open("rb") as opened:
        start = opened.read(MOST_MCAP_HEADER)
        opened.seek(-min(MOST_MCAP_SUMMARY, path.stat().st_size), os.SEEK_END)
        end = opened.read()
    found = re.match(rb"\x89MCAP0\r\n\x01.{8}(.{4})", start, re.DOTALL)
    if found is None:
        return None
    profile = start[found.end() :][: int.from_bytes(found[1], "little")]
    if profile == b"ros2":
        return None
    if profile == b"ros1":
        return "an MCAP of ROS 1", "use the .bag that it was made from"
    known = [name for name in MCAP_ENCODINGS if len(name).to_bytes(4, "little") + name.encode() in end]
    messages = f", with messages in {' and '.join(known)}" if known else ""
    advice = "record the topics of ROS 2 instead (ros2 bag record --storage mcap), or write images and poses to a transforms.json"
    return f"an MCAP of another program than ROS 2{messages}", advice


def check_definitions(reader: Any) -> None:
    """Check the types that an opened bag defines: rosbags writes code for them, several lines for each element of an array of texts or of messages.

    Raises:
        ValueError: one is too long.
    """
    from rosbags.interfaces import Nodetype

    for name, (_, fields) in reader.typestore.fielddefs.items():
        for field, (kind, content) in fields:
            if kind == Nodetype.ARRAY and content[1] > (MOST_NUMBERS if _is_number(content[0]) else MOST_ELEMENTS):
                raise ValueError(f"{content[1]:,} elements in {name}.{field}")


def _bounded(parse: Callable[..., Any]) -> Callable[..., Any]:
    """A parser of definitions that refuses long ones, and IDL with nested parentheses or with any in a constant: each pair multiplies rosbags' time by fifty."""

    @wraps(parse)
    def checked(text: str, *more: Any) -> Any:
        if len(text) > MOST_DEFINITION:
            raise ValueError(f"a definition of more than {MOST_DEFINITION:,} characters")
        bare = re.sub(r'"(?:[^"\\]|\\.)*+"|//[^\n]*+|/\*.*?\*/', "", text, flags=re.DOTALL)
        if not more and (re.search(r"\bconst\b[^;]*\(|\([^()]*\(", bare) or "<<" in bare):
            raise ValueError("a definition with computed constants or nested parentheses")
        return parse(text, *more)

    return checked


def _is_number(described: tuple[Any, Any]) -> bool:
    """Whether elements of an array, as rosbags describes them, are numbers, which are read at once."""
    from rosbags.interfaces import Nodetype

    kind, content = described
    return kind == Nodetype.BASE and content[0] != "string"


def inflate(data: bytes, decompressor: Callable[[], Any]) -> bytes:
    """What compressed data become, at most `MOST_CHUNK` bytes.

    Args:
        data: one or more streams, one behind the other.
        decompressor: makes an object for one stream, as `bz2.BZ2Decompressor` does.

    Raises:
        ValueError: they would become more, or end early.
    """
    parts, left = list[bytes](), MOST_CHUNK
    while data:
        stream = decompressor()
        parts.append(stream.decompress(data, max_length=left + 1))
        left -= len(parts[-1])
        if left < 0:
            raise ValueError(f"a compressed part of more than {MOST_CHUNK:,} bytes")
        if not stream.eof:
            raise ValueError("a compressed part that ends early")
        data = stream.unused_data or b""
    return b"".join(parts)


def _check_metadata(file: Path) -> None:
    """Check the list of a bag's topics, if there is one, before it is read: a few lines of YAML can stand for more values than fit into memory.

    Raises:
        ValueError: it is too long, or repeats parts of itself.
    """
    from ruamel.yaml import YAML
    from ruamel.yaml.events import AliasEvent

    if not file.is_file():
        return
    with file.open("rb") as opened:
        text = opened.read(MOST_METADATA + 1)
    if len(text) > MOST_METADATA:
        raise ValueError(f"{METADATA} has more than {MOST_METADATA:,} bytes")
    if any(isinstance(event, AliasEvent) for event in YAML(typ="safe", pure=True).parse(text)):
        raise ValueError(f"{METADATA} repeats parts of itself (an alias of YAML)")


class _Sqlite:
    """The module apsw as rosbags calls it: a name is a name, although %2e is a dot in the addresses that SQLite takes, and values have a limit."""

    def __init__(self, apsw: Any) -> None:
        self._apsw = apsw

    def __getattr__(self, name: str) -> Any:
        return getattr(self._apsw, name)

    def Connection(self, address: str, **options: Any) -> Any:
        """The database of "file:PATH?immutable=1", where PATH is as it is on disk."""
        path = Path(address.removeprefix("file:").removesuffix("?immutable=1")).absolute()
        opened = self._apsw.Connection(f"file:{quote(str(path))}?immutable=1", **options)
        opened.limit(self._apsw.SQLITE_LIMIT_LENGTH, MOST_CHUNK)
        for feature in ("TRUSTED_SCHEMA", "ENABLE_VIEW", "ENABLE_TRIGGER"):  # a bag has plain tables
            opened.config(getattr(self._apsw, f"SQLITE_DBCONFIG_{feature}"), 0)
        return opened


class _Zstd:
    """The functions of Python's zstd that rosbags calls, with limits."""

    def __init__(self, zstd: Any) -> None:
        self._zstd = zstd

    def decompress(self, data: bytes) -> bytes:
        """What data become."""
        return inflate(data, self._zstd.ZstdDecompressor)

    def open(self, file: BinaryIO, mode: str) -> _Growing:
        """A file that is read, inflated."""
        length = os.fstat(file.fileno()).st_size
        return _Growing(self._zstd.open(file, mode), MOST_GROWTH * length + MOST_CHUNK)


class _Growing:
    """A file of which at most `left` bytes can be read; then an error tells it."""

    def __init__(self, file: Any, left: int) -> None:
        self._file, self._left = file, left

    def __enter__(self) -> _Growing:
        return self

    def __exit__(self, *error: object) -> None:
        self._file.close()

    def read(self, size: int = -1) -> bytes:
        """The next bytes."""
        data: bytes = self._file.read(min(size, MOST_CHUNK) if size >= 0 else MOST_CHUNK)
        self._left -= len(data)
        if self._left < 0:
            raise ValueError(f"a compressed bag that becomes more than {MOST_GROWTH} times longer")
        return data


@cache
def _bound_rosbags() -> None:
    """Give rosbags functions that inflate no more than `MOST_CHUNK` at once: its own inflate whatever a few kilobytes say.

    It looks them up in tables, or in its modules. A version that has them elsewhere stays as it is.
    """
    from lz4.frame import LZ4FrameDecompressor
    from rosbags.highlevel import anyreader
    from rosbags.rosbag1 import reader as reader_of_ros_1
    from rosbags.rosbag2 import reader as reader_of_ros_2
    from rosbags.rosbag2 import storage_mcap, storage_sqlite3

    if not isinstance(storage_sqlite3.apsw, _Sqlite):
        vars(storage_sqlite3)["apsw"] = _Sqlite(storage_sqlite3.apsw)

    for name in ("get_types_from_msg", "get_types_from_idl"):
        if not hasattr(parse := getattr(anyreader, name), "__wrapped__"):
            vars(anyreader)[name] = _bounded(parse)

    streams: dict[str, Callable[[], Any]] = {"bz2": bz2.BZ2Decompressor, "lz4": LZ4FrameDecompressor}
    zstd: Any = getattr(reader_of_ros_2, "zstd", None)
    if hasattr(zstd, "ZstdDecompressor"):
        streams["zstd"] = zstd.ZstdDecompressor
        vars(reader_of_ros_2)["zstd"] = _Zstd(zstd)
    for table in (getattr(reader_of_ros_1, "decompressors", {}), getattr(storage_mcap, "DECOMPRESSORS", {})):
        for name in table.keys() & streams.keys():
            table[name] = lambda data, *_, stream=streams[name]: inflate(data, stream)


@cache
def message_store() -> Any:
    """rosbags' types of ROS 2 and vision_msgs, which make, serialise and read messages. It is shared: register nothing.

    Raises:
        ImportError: rosbags is not installed.
    """
    with needs_extra("ros", "messages of ROS need rosbags", "rosbags"):
        from rosbags.typesys import Stores, get_types_from_msg, get_typestore
    store = get_typestore(Stores.ROS2_HUMBLE)
    for name, definition in VISION.items():
        store.register(get_types_from_msg(definition, f"vision_msgs/msg/{name}"))
    return store


def check_bag_library() -> None:
    """Check that bags can be written.

    Raises:
        ImportError: rosbags is not installed.
    """
    with needs_extra("ros", "writing a ROS bag needs rosbags", "rosbags"):
        import rosbags.rosbag2  # noqa: F401


def write_message(path: Path, topic: str, time: int, message: Callable[[dict[str, Any]], Any]) -> None:
    """Write a bag of ROS 2 with one message, as one `.mcap` file. Subscribers that come later get the message too.

    Args:
        path: the file.
        topic: of the message.
        time: when it was recorded [ns].
        message: makes the message from the classes of all types, by their names, such as "std_msgs/msg/Header".

    Raises:
        ImportError: rosbags is not installed.
        OSError: it cannot be written.
    """
    check_bag_library()
    from rosbags import interfaces as ros
    from rosbags.rosbag2 import StoragePlugin, Writer

    store = message_store()
    made = message(store.types)
    never = ros.QosTime(0, 0)
    latched = ros.Qos(
        ros.QosHistory.KEEP_LAST, 1, ros.QosReliability.RELIABLE, ros.QosDurability.TRANSIENT_LOCAL, never, never,
        ros.QosLiveliness.AUTOMATIC, never, False,
    )  # fmt: skip
    with TemporaryDirectory(dir=path.parent, prefix=f".{path.name}.") as folder:
        bag = Path(folder) / path.stem
        with Writer(bag, version=8, storage_plugin=StoragePlugin.MCAP) as writer:
            connection = writer.add_connection(topic, made.__msgtype__, typestore=store, offered_qos_profiles=[latched])
            writer.write(connection, time, store.serialize_cdr(made, made.__msgtype__))
        (bag / f"{bag.name}.mcap").replace(path)
