"""ROS bags: their topics and messages, and images as files. Read with rosbags; ROS is not needed.

ROS 2 (`metadata.yaml` with `.db3` or `.mcap`, or one such file) and ROS 1 (`.bag`).
"""

from __future__ import annotations

import contextlib
import os
import threading
import weakref
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from functools import lru_cache
from pathlib import Path
from typing import Any

from semgs.data.layouts.ros.cut_bags import CutRecording, recordings_of
from semgs.data.layouts.ros.image_messages import as_file, ending_of
from semgs.files.bags import METADATA, bag_reader, check_definitions, foreign_mcap
from semgs.files.errors import InputError, readable
from semgs.files.text import listed

IMAGE, COMPRESSED = "sensor_msgs/msg/Image", "sensor_msgs/msg/CompressedImage"
REPAIRS = {
    ".bag": "if its recorder was stopped early, rosbag reindex repairs it",
    ".db3": "if its recorder was stopped early, sqlite3 FILE .recover repairs it",
}
"""What repairs files of these endings."""

LISTED = 8
"""How many topics an error names."""


@dataclass(frozen=True, slots=True)
class BagFile:
    """An image or depth map in a bag, as a file.

    Attributes:
        bag: the bag's path.
        topic: of the message.
        logged: when the message was recorded [ns].
        stamp: the time in its header [ns], in case several were recorded at once.
        suffix: the ending of the file.
    """

    bag: Path
    topic: str
    logged: int
    stamp: int
    suffix: str

    @property
    def name(self) -> str:
        """The time in its header [s], with the ending."""
        return _seconds(self.stamp) + self.suffix

    def is_file(self) -> bool:
        """Whether the bag still exists; the message existed when the bag was opened."""
        return self.bag.exists()

    def read_bytes(self) -> bytes:
        """The file.

        Raises:
            OSError: the message is gone, or its pixels cannot be read.
        """
        for _, message in open_bag(self.bag).messages([self.topic], self.logged, self.logged + 1):
            if stamp_of(message) == self.stamp:
                try:
                    return as_file(message)
                except (AttributeError, TypeError, ValueError) as error:
                    raise OSError(str(error)) from error
        raise OSError("the message is no longer in the bag")

    def __str__(self) -> str:
        return f"{self.bag}: {self.topic} at {_seconds(self.stamp)}"


class Bag:
    """An open bag: its topics and messages.

    Attributes:
        path: of the bag.
        topics: the type of each topic with messages.
        cut: the names of its recordings that end early; what is before their end is read.

    Raises:
        InputError: it is damaged, or the name or type of a topic is not text.
        ImportError: rosbags is not installed.
    """

    def __init__(self, path: Path) -> None:
        self.path = path
        try:
            self._reader = bag_reader(path, recordings_of(path))
            self._reader.open()
            weakref.finalize(self, _close, self._reader)
            check_definitions(self._reader)
        except ImportError:
            raise
        except Exception as error:  # each storage raises its own
            found, advice = foreign_mcap(path) or (f"one that rosbags cannot read: {error}", REPAIRS.get(path.suffix))
            raise InputError(path, "a ROS bag", found, advice=advice) from error
        self.cut = [one.name for one in self._reader.paths if isinstance(one, CutRecording)]
        for one in self._reader.connections:
            if not isinstance(one.topic, str):  # such as an unquoted 5 in YAML
                raise InputError(path, "names of topics", f"{one.topic!r}, which is not text", METADATA)
            if not isinstance(one.msgtype, str):
                raise InputError(path, "types of topics", f"{one.msgtype!r}, which is not text", METADATA)
        try:
            self.topics = {topic: info.msgtype or "" for topic, info in self._reader.topics.items() if info.msgcount}
        except TypeError as error:
            raise InputError(path, "numbers of messages", f"something else: {error}", METADATA) from error

    def of(self, *types: str) -> list[str]:
        """The topics of some types, sorted."""
        return sorted(topic for topic, kind in self.topics.items() if kind in types)

    def messages(
        self, topics: Sequence[str], start: int | None = None, stop: int | None = None
    ) -> Iterator[tuple[tuple[str, int], Any]]:
        """The messages of some topics, each with its topic and the time when it was recorded [ns].

        Raises:
            InputError: the bag is damaged.
        """
        connections = [one for one in self._reader.connections if one.topic in topics]
        if not connections:
            return
        try:
            for connection, logged, data in self._reader.messages(connections, start, stop):
                yield (connection.topic, logged), self._reader.deserialize(data, connection.msgtype)
        except InputError:
            raise
        except Exception as error:  # sqlite, mcap, zstd and the deserialiser raise their own
            found = f"some that cannot be read: {error}"
            raise InputError(self.path, "complete messages", found, ", ".join(topics)) from error

    def first(self, topic: str) -> Any:
        """The first message of a topic.

        Raises:
            InputError: there is none, or the bag is damaged.
        """
        for _, message in self.messages([topic]):
            return message
        raise InputError(self.path, "messages", "none", topic)

    def files(self, topic: str) -> list[BagFile]:
        """The images or depth maps of a topic, sorted by the times in their headers; of two with the same time, the first.

        Raises:
            InputError: the bag is damaged.
        """
        found: dict[int, BagFile] = {}
        for (_, logged), message in self.messages([topic]):
            stamp = stamp_of(message)
            found.setdefault(stamp, BagFile(self.path, topic, logged, stamp, ending_of(message)))
        return [found[stamp] for stamp in sorted(found)]

    def count(self, topic: str) -> int:
        """The number of messages of a topic."""
        return int(self._reader.topics[topic].msgcount)

    def counted(self, topics: Sequence[str]) -> str:
        """Topics as text, with their numbers of messages."""
        counts = self._reader.topics
        return listed([f"{topic} ({counts[topic].msgcount})" for topic in topics], LISTED) or "none"

    def __str__(self) -> str:
        """All topics, with their types."""
        shown = [f"{topic} ({kind.rpartition('/')[2]})" for topic, kind in sorted(self.topics.items())]
        return f"topics {listed(shown, 2 * LISTED)}" if shown else "an empty bag"


def open_bag(path: Path) -> Bag:
    """The bag at a path. Bags stay open, for each thread.

    Raises:
        InputError, ImportError: as `Bag`.
    """
    file = path / METADATA if path.is_dir() else path
    with readable(file):
        stat = file.stat()
    return _opened(path.absolute(), stat.st_mtime_ns, stat.st_size, os.getpid(), threading.get_ident())


def stamp_of(message: Any) -> int:
    """The time in the header of a message [ns]."""
    stamp = message.header.stamp
    return int(stamp.sec) * 10**9 + int(stamp.nanosec)


def frame_id_of(message: Any) -> str:
    """The frame in the header of a message, without ROS 1's leading slash."""
    return str(message.header.frame_id).lstrip("/")


@lru_cache(maxsize=4)
def _opened(path: Path, modified: int, size: int, process: int, thread: int) -> Bag:
    """The bag at a path; the other arguments show when an open bag cannot be used again."""
    return Bag(path)


def _close(reader: Any) -> None:
    """Close a reader that is no longer used."""
    with contextlib.suppress(Exception):  # perhaps from another thread
        reader.close()


def _seconds(time: int) -> str:
    """A time [ns] in seconds, all digits."""
    return f"{time // 10**9}.{time % 10**9:09d}"
