"""ROS bags: 2 (`metadata.yaml` with `.db3` or `.mcap`, or one such file) and 1 (`.bag`), read by rosbags, without ROS.

Pictures are `sensor_msgs/Image` or `CompressedImage` messages, at the time in their header. They come with a `CameraInfo`, whose pixels have
the centre of the first at (0, 0) as all that OpenCV calibrates: half a pixel is added to cx and cy. Of a rectified picture (`rect` in
its topic) P counts, of a raw one K and the distortion, which is undone. Depth is taken where it is registered to the picture: in the same
optical frame; 16 bits are millimetres, floats metres.

Poses come from TF, `nav_msgs/Odometry` or `geometry_msgs/PoseStamped`, interpolated to the time of each picture, along the tree of frames
from the picture's own, which REP 103 wants optical (x right, y down, z forward), up to the world. Where there are several cameras, worlds or
topics of poses and nothing tells them apart, they are listed, and one has to be named.
"""

from __future__ import annotations

import contextlib
import os
import threading
import weakref
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from functools import lru_cache
from pathlib import Path
from typing import Any

import numpy as np

from semgs.data.asked import Asked
from semgs.data.frames import Frame
from semgs.data.layouts.parts.association import associated
from semgs.data.layouts.parts.calibrations import asked_calibration
from semgs.data.layouts.ros.images import GREYS, as_file, encoding_of, ending_of, is_depth
from semgs.data.layouts.ros.motions import Motion, above, along, motion
from semgs.data.lens import HALF, Lens
from semgs.data.maps import DepthMap
from semgs.data.scene import Scene
from semgs.files.errors import InputError
from semgs.files.pictures import read_header

LAYOUT = "ROS bag"
LOOKED_FOR = "a ROS bag (metadata.yaml with .db3 or .mcap; .mcap; .bag)"
ASKS = ("camera", "world", "body", "intrinsics")
ENDINGS = (".mcap", ".db3", ".bag")

IMAGE, COMPRESSED = "sensor_msgs/msg/Image", "sensor_msgs/msg/CompressedImage"
INFO, ODOMETRY = "sensor_msgs/msg/CameraInfo", "nav_msgs/msg/Odometry"
TF = ("tf2_msgs/msg/TFMessage", "tf/msg/tfMessage")
POSES = ("geometry_msgs/msg/PoseStamped", "geometry_msgs/msg/PoseWithCovarianceStamped")
TRANSPORTS = ("compressed", "compressedDepth", "theora", "zstd", "ffmpeg", "raw")
"""What image_transport puts behind a topic's name."""

MODELS = ("", "plumb_bob", "none", "pinhole", "rational_polynomial")
"""Distortion models that k1, k2, p1, p2, k3 cover, where the further numbers are 0."""

MILLIMETRE = 0.001
DEPTH_TOLERANCE = 0.02
"""Depth maps are at most this far in time from their picture [s]."""
LISTED = 8


def recognises(path: Path) -> bool:
    """Whether a path is a bag: its folder, or the one file that it is in."""
    if path.is_file():
        return path.suffix.lower() in ENDINGS
    try:
        return "rosbag2_bagfile_information" in (path / "metadata.yaml").read_text(errors="replace")[:4000]
    except OSError:
        return False


def open_bag(path: Path, asked: Asked) -> Scene:
    """The scene of a bag: the pictures of one camera, in the order of their times.

    Args:
        path: its folder or file.
        asked: which camera and world, if there are several; the body of poses that do not say; other intrinsics.

    Raises:
        InputError: it is damaged, has no pictures, intrinsics or poses, or several and nothing tells which; what is there is listed.
        ImportError: rosbags is not installed.
    """
    bag = _open(path)
    pictures = _camera(bag, asked.camera)
    first = bag.first(pictures)
    frame_id = first.header.frame_id.lstrip("/")
    if not frame_id:
        raise InputError(path, "the frame of the camera in the header of its pictures", "an empty frame_id", pictures)
    stamps = bag.stamps(pictures)
    lens, told = _lens(bag, pictures, frame_id, first, asked)
    route, led = _route(bag, frame_id, asked)
    notes = [f"Pictures are those of {pictures}.", *told, *led]
    poses = along(route, np.array([stamp for stamp, _ in stamps], dtype=np.int64))
    depths, told = _depths(bag, pictures, frame_id, stamps)
    notes += told
    ending, unit = ending_of(first), _depth_unit(depths)
    frames = tuple(
        Frame(
            name=_seconds(stamp) + ending,
            picture=BagFile(path, pictures, logged, stamp, ending),
            lens=lens,
            world_from_camera=pose,
            depth=DepthMap(depths[index], unit) if index in depths else None,
        )
        for index, ((stamp, logged), pose) in enumerate(zip(stamps, poses, strict=True))
        if np.isfinite(pose).all()
    )
    without = len(stamps) - len(frames)
    if without:
        notes.append(
            f"{without} of {len(stamps)} pictures are at times of no known pose and are left out, the first of them at "
            f"{next(stamp for (stamp, _), pose in zip(stamps, poses, strict=True) if not np.isfinite(pose).all()) / 1e9:.3f} s."
        )
    if len(frames) < 2:
        raise InputError(
            path, "at least two pictures at times of known poses", f"{len(frames)} of {len(stamps)}", pictures,
            advice=" ".join([*led, *(f"{step.source} has {step.parent} > {step.child} {_span(step.times)}." for step in route if not step.fixed)]),
        )  # fmt: skip
    return Scene(
        path=path,
        name=path.absolute().name if path.is_dir() else path.stem,
        layout=LAYOUT,
        unit="metric",
        frames=frames,
        notes=tuple(notes),
    )


@dataclass(frozen=True, slots=True)
class BagFile:
    """A message of a bag as the file that it would be.

    Attributes:
        bag: the bag's path.
        topic: of the message.
        logged: when it was recorded, by which it is found [ns].
        stamp: the time in its header, which tells it from others recorded at once [ns].
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
        """Whether the bag is there; the message was, when the bag was opened."""
        return self.bag.exists()

    def read_bytes(self) -> bytes:
        """The file.

        Raises:
            OSError: the message is not there any more, or its pixels cannot be read.
        """
        for _, message in _open(self.bag).messages([self.topic], self.logged, self.logged + 1):
            if _stamp(message) == self.stamp:
                try:
                    return as_file(message)
                except ValueError as error:
                    raise OSError(str(error)) from error
        raise OSError("the message is not in the bag any more")

    def __str__(self) -> str:
        return f"{self.bag}: {self.topic} at {_seconds(self.stamp)}"


class _Bag:
    """An open bag: its topics and messages."""

    def __init__(self, path: Path) -> None:
        try:
            from rosbags.highlevel import AnyReader
            from rosbags.typesys import Stores, get_typestore
        except ImportError as error:
            raise ImportError(
                f"{path} is a ROS bag; reading it needs rosbags: pip install '.[ros]' in SemGS's folder", name="rosbags"
            ) from error
        self.path = path
        try:
            self._reader = AnyReader([path], default_typestore=get_typestore(Stores.LATEST))
            self._reader.open()
        except Exception as error:  # whatever the readers of several storages raise on damage
            raise InputError(path, "a ROS bag", f"one that rosbags cannot read: {error}") from error
        weakref.finalize(self, _close, self._reader)
        for one in self._reader.connections:
            if not isinstance(one.topic, str):  # as YAML has 5 without quotes
                raise InputError(path, "names of topics", f"{one.topic!r}, which is no text", "metadata.yaml")
        self.topics = {topic: info.msgtype or "" for topic, info in self._reader.topics.items() if info.msgcount}
        self.counts = {topic: info.msgcount for topic, info in self._reader.topics.items()}

    def of(self, *types: str) -> list[str]:
        """The topics of some types, by name."""
        return sorted(topic for topic, kind in self.topics.items() if kind in types)

    def messages(
        self, topics: Sequence[str], start: int | None = None, stop: int | None = None
    ) -> Iterator[tuple[tuple[str, int], Any]]:
        """The messages of some topics, each after its topic and the time at which it was recorded [ns].

        Raises:
            InputError: the bag is damaged there.
        """
        connections = [one for one in self._reader.connections if one.topic in topics]
        if not connections:
            return
        try:
            for connection, logged, data in self._reader.messages(connections, start, stop):
                yield (connection.topic, logged), self._reader.deserialize(data, connection.msgtype)
        except InputError:
            raise
        except Exception as error:  # sqlite, mcap, zstd and the deserialiser each have their own
            raise InputError(
                self.path, "complete messages", f"some that cannot be read: {error}", ", ".join(topics)
            ) from error

    def first(self, topic: str) -> Any:
        """The first message of a topic.

        Raises:
            InputError: there is none, or the bag is damaged.
        """
        for _, message in self.messages([topic]):
            return message
        raise InputError(self.path, "messages", "none", topic)

    def stamps(self, topic: str) -> list[tuple[int, int]]:
        """The time in the header of each message of a topic and the time at which it was recorded [ns], ascending, each header's once.

        Raises:
            InputError: the bag is damaged.
        """
        found: dict[int, int] = {}
        for (_, logged), message in self.messages([topic]):
            found.setdefault(_stamp(message), logged)
        return sorted(found.items())


def _close(reader: Any) -> None:
    """Close a reader that nobody uses any more."""
    with contextlib.suppress(Exception):  # perhaps from another thread than that which opened it
        reader.close()


def _open(path: Path) -> _Bag:
    """The bag at a path; one that was opened before in this thread is still open.

    Raises:
        InputError: it cannot be read.
    """
    file = path / "metadata.yaml" if path.is_dir() else path
    try:
        stat = file.stat()
    except OSError as error:
        raise InputError(file, "a ROS bag", error.strerror or str(error)) from error
    return _opened(path.absolute(), stat.st_mtime_ns, stat.st_size, os.getpid(), threading.get_ident())


@lru_cache(maxsize=4)
def _opened(path: Path, modified: int, size: int, process: int, thread: int) -> _Bag:
    """The bag at a path; the other arguments tell when one that is open cannot be used again."""
    return _Bag(path)


def _camera(bag: _Bag, asked: str | None) -> str:
    """The topic of the pictures to take.

    Raises:
        InputError: there is none, or there are several cameras and nothing tells which; they are listed.
    """
    topics = bag.of(IMAGE, COMPRESSED)
    if asked is not None:
        chosen = [topic for topic in topics if topic == asked or topic.startswith(asked.rstrip("/") + "/")]
        if not chosen:
            raise InputError(bag.path, f"pictures in a topic that begins with {asked}", _listed(bag, topics), "camera")
        topics = chosen
    kinds = {topic: bag.first(topic) for topic in topics}
    topics = [topic for topic in topics if not is_depth(kinds[topic])]
    if not topics:
        raise InputError(bag.path, "topics of type Image or CompressedImage", _all_topics(bag), "camera")
    coloured = [topic for topic in topics if encoding_of(kinds[topic]) not in GREYS]
    topics = coloured or topics
    namespaces = {_namespace(topic) for topic in topics}
    plain = {_plain(topic) for topic in topics}
    if len(namespaces) > 1 or (len(plain) > 1 and not any("rect" in _base(topic) for topic in plain)):
        raise InputError(bag.path, "one camera", _listed(bag, topics), "camera", advice="name one: --camera TOPIC")
    # Of one camera: rectified before raw, for there is nothing to undo; uncompressed before compressed.
    return min(topics, key=lambda topic: ("rect" not in _base(topic), bag.topics[topic] == COMPRESSED, topic))


def _lens(bag: _Bag, pictures: str, frame_id: str, first: Any, asked: Asked) -> tuple[Lens, list[str]]:
    """The lens of the pictures, and what to tell of it.

    Raises:
        InputError: there is no CameraInfo, it is for other pictures, or its lens cannot be undone.
    """
    logged = next(iter(bag.messages([pictures])))[0][1]
    header = read_header(BagFile(bag.path, pictures, logged, _stamp(first), ending_of(first)))
    given = asked_calibration(asked)
    if given is not None:
        return given.lens(Path(pictures), header.size), []
    wanted = f"{_namespace(pictures)}/camera_info"
    topics = (
        [wanted]
        if wanted in bag.topics
        else [t for t in bag.of(INFO) if bag.first(t).header.frame_id.lstrip("/") == frame_id]
    )
    if len(topics) != 1:
        raise InputError(
            bag.path, f"a CameraInfo in {wanted}, or one of the frame {frame_id}", _listed(bag, bag.of(INFO)), pictures,
            advice="or give the intrinsics: --intrinsics fx fy cx cy",
        )  # fmt: skip
    info = bag.first(topics[0])
    lens = lens_of(bag.path, topics[0], info, header.size, rectified="rect" in _base(pictures))
    notes = [] if "optical" in frame_id else [
        f"The frame of the pictures, {frame_id}, is not called optical; it is taken to have x right, y down and z forward, as REP 103 wants."
    ]  # fmt: skip
    return lens, notes


def lens_of(path: Path, topic: str, info: Any, size: tuple[int, int], *, rectified: bool) -> Lens:
    """The lens that a CameraInfo describes.

    K and P are of the whole sensor; binning and the region of interest lead to the pictures. https://docs.ros.org/en/rolling/p/sensor_msgs

    Raises:
        InputError: it is for other pictures, not calibrated, or of a lens that k1, k2, p1, p2, k3 do not cover.
    """
    k, d, p = (
        np.asarray(getattr(info, name, None) if hasattr(info, name) else getattr(info, name.upper())) for name in "kdp"
    )
    matrix = p.reshape(3, 4)[:, :3] if rectified else k.reshape(3, 3)
    if not matrix[0, 0] > 0:
        raise InputError(
            path, "a calibrated camera", "zeros for its focal length", topic, "or give them: --intrinsics fx fy cx cy"
        )
    bins = max(1, int(info.binning_x)), max(1, int(info.binning_y))
    roi = info.roi
    whole = not (roi.width and roi.height)
    width, height = (int(info.width), int(info.height)) if whole else (int(roi.width), int(roi.height))
    if (height // bins[1], width // bins[0]) != size and size != (height, width):
        raise InputError(
            path,
            f"a CameraInfo for {size[1]}x{size[0]} pixels (width x height), as the pictures are",
            f"{width}x{height}",
            topic,
        )
    if size == (height, width):
        bins = 1, 1
    x, y = (0, 0) if whole else (int(roi.x_offset), int(roi.y_offset))
    centre = (matrix[0, 2] + HALF - x) / bins[0], (matrix[1, 2] + HALF - y) / bins[1]
    focal = float(matrix[0, 0] / bins[0]), float(matrix[1, 1] / bins[1])
    if rectified or not np.any(d):
        distortion = (0.0, 0.0, 0.0, 0.0, 0.0)
    elif str(info.distortion_model) in MODELS and not np.any(d[5:]):
        distortion = tuple(float(value) for value in [*d[:5], *[0.0] * 5][:5])  # type: ignore[assignment]
    else:
        raise InputError(
            path, "a lens of plumb_bob with k1, k2, p1, p2, k3", f"{info.distortion_model} with {d.tolist()}", topic,
            advice="record rectified pictures (image_proc), or give the intrinsics of undistorted ones",
        )  # fmt: skip
    try:
        return Lens(size, focal, (float(centre[0]), float(centre[1])), distortion)
    except ValueError as error:
        raise InputError(path, "a camera that can be", str(error), topic) from error


def _route(bag: _Bag, frame_id: str, asked: Asked) -> tuple[list[Motion], list[str]]:
    """The motions that lead from the camera's frame up to the world, and what to tell of them.

    Raises:
        InputError: no poses lead there, or several do and nothing tells which; what is there is listed.
    """
    tree = _tree(bag)
    moving = [
        one for topic in (*bag.of(ODOMETRY), *bag.of(*POSES)) if (one := _moving(bag, topic, frame_id, asked.body))
    ]
    if asked.body is not None and all(_says_of_what(bag.first(step.source)) for step in moving):
        raise InputError(bag.path, "a topic of poses that do not say of what they are", _all_topics(bag), "body")
    routes = {"TF": above(tree, frame_id)}
    for step in moving:
        routes[step.source] = above({**tree, step.child: step}, frame_id)
    routes = {
        source: route for source, route in routes.items()
        if any(not step.fixed for step in route) and (source == "TF" or any(step.source == source for step in route))
    }  # fmt: skip
    if asked.world is not None:
        world = asked.world.lstrip("/")
        if asked.world in routes:
            routes = {asked.world: routes[asked.world]}
        else:
            routes = {
                source: cut for source, route in routes.items()
                if (cut := _cut(route, world)) and (source == "TF" or any(step.source == source for step in cut))
            }  # fmt: skip
        if not routes:
            raise InputError(
                bag.path,
                f"poses of {frame_id} in {asked.world}, by TF, Odometry or PoseStamped",
                _ways(bag, tree, moving, frame_id),
                "world",
            )
    if not routes:
        raise InputError(
            bag.path, f"poses of {frame_id} by TF, Odometry or PoseStamped", _ways(bag, tree, moving, frame_id), "world",
            advice="a bag needs /tf and /tf_static, or a topic of poses with /tf_static",
        )  # fmt: skip
    if "TF" in routes:
        routes = {"TF": routes["TF"]}
    if len(routes) > 1:
        found = "; ".join(f"{source} ({route[-1].parent})" for source, route in routes.items())
        raise InputError(bag.path, "one topic of poses", found, "world", advice="name one: --world TOPIC")
    source, route = next(iter(routes.items()))
    chain = " > ".join([*(step.parent for step in reversed(route)), frame_id])
    notes = [f"Poses are by {source}: {chain}, interpolated in time."]
    if source in bag.topics and asked.body is None and not _says_of_what(bag.first(source)):
        notes.append(
            f"The poses of {source} do not say of what they are, and are taken as those of the camera's frame {frame_id} (--body)."
        )
    return route, notes


def _says_of_what(message: Any) -> bool:
    """Whether a message with a pose names the frame that it is of, as Odometry does."""
    return bool(getattr(message, "child_frame_id", ""))


def _cut(route: list[Motion], world: str) -> list[Motion]:
    """The part of a route that ends in a frame; empty where it does not pass there, or does not move before."""
    for index, step in enumerate(route):
        if step.parent == world:
            part = route[: index + 1]
            return part if any(not one.fixed for one in part) else []
    return []


def _tree(bag: _Bag) -> dict[str, Motion]:
    """The motions of TF by child; of one that is both static and not, the moving one."""
    samples: dict[tuple[str, str, bool], dict[int, tuple[np.ndarray, np.ndarray]]] = {}
    topics = bag.of(*TF)
    for (topic, logged), message in bag.messages(topics):
        fixed = topic.endswith("tf_static")
        for one in message.transforms:
            place, turn = one.transform.translation, one.transform.rotation
            key = (one.header.frame_id, one.child_frame_id, fixed)
            time = logged if fixed else _stamp(one)
            samples.setdefault(key, {})[time] = (
                np.array([place.x, place.y, place.z]),
                np.array([turn.x, turn.y, turn.z, turn.w]),
            )
    found: dict[str, Motion] = {}
    for (parent, child, fixed), held in sorted(samples.items(), key=lambda item: (not item[0][2], len(item[1]))):
        step = motion(parent, child, held, "/tf_static" if fixed else "/tf", fixed=fixed)
        if step is not None:
            found[step.child] = step
    return found


def _moving(bag: _Bag, topic: str, frame_id: str, body: str | None) -> Motion | None:
    """The motion that an Odometry or PoseStamped topic tells; None where it has no pose."""
    samples: dict[int, tuple[np.ndarray, np.ndarray]] = {}
    parent = child = ""
    for _, message in bag.messages([topic]):
        pose = message.pose.pose if hasattr(message.pose, "pose") else message.pose
        place, turn = pose.position, pose.orientation
        parent, child = message.header.frame_id, getattr(message, "child_frame_id", "") or body or frame_id
        samples[_stamp(message)] = np.array([place.x, place.y, place.z]), np.array([turn.x, turn.y, turn.z, turn.w])
    return motion(parent or topic, child, samples, topic)


def _depths(
    bag: _Bag, pictures: str, frame_id: str, stamps: list[tuple[int, int]]
) -> tuple[dict[int, BagFile], list[str]]:
    """The depth map of each picture by its position, and what to tell of depth that is not used."""
    aside: list[tuple[str, Any]] = []
    registered: list[tuple[str, Any]] = []
    for topic in bag.of(IMAGE, COMPRESSED):
        message = bag.first(topic)
        if is_depth(message):
            (registered if message.header.frame_id.lstrip("/") == frame_id else aside).append((topic, message))
    if not registered:
        return {}, [
            f"Depth of {topic} is of the frame {message.header.frame_id}, not registered to the pictures, and left out."
            for topic, message in aside
        ]
    topic, message = min(registered, key=lambda one: (bag.topics[one[0]] == COMPRESSED, one[0]))
    held, start = bag.stamps(topic), stamps[0][0]
    seconds = [np.array([(stamp - start) / 1e9 for stamp, _ in some]) for some in (stamps, held)]
    pairs = associated(seconds[0], seconds[1], DEPTH_TOLERANCE)
    found = {
        index: BagFile(bag.path, topic, held[other][1], held[other][0], ending_of(message))
        for index, other in pairs.items()
    }
    missing = len(stamps) - len(found)
    return found, [
        f"{missing} of {len(stamps)} pictures have no depth map of {topic} at their time."
    ] if missing else []


def _depth_unit(depths: Mapping[int, BagFile]) -> float:
    """What one count of the depth maps is worth [m]: metres where they are floats."""
    return 1.0 if any(one.suffix == ".npy" for one in depths.values()) else MILLIMETRE


def _stamp(message: Any) -> int:
    """The time in the header of a message [ns]."""
    stamp = message.header.stamp
    return int(stamp.sec) * 10**9 + int(stamp.nanosec)


def _seconds(time: int) -> str:
    """A time [ns] in seconds, all digits."""
    return f"{time // 10**9}.{time % 10**9:09d}"


def _plain(topic: str) -> str:
    """A topic's name without what image_transport puts behind it."""
    head, _, tail = topic.rpartition("/")
    return head if tail in TRANSPORTS else topic


def _namespace(topic: str) -> str:
    """The camera that an image topic is of: all of its name but the last part."""
    return _plain(topic).rpartition("/")[0]


def _base(topic: str) -> str:
    """The last part of an image topic's name."""
    return _plain(topic).rpartition("/")[2]


def _span(times: np.ndarray) -> str:
    """From when to when something is known."""
    return f"from {times[0] / 1e9:.3f} to {times[-1] / 1e9:.3f} s" if len(times) else "never"


def _ways(bag: _Bag, tree: Mapping[str, Motion], moving: Iterable[Motion], frame_id: str) -> str:
    """What there is of poses."""
    chain = [frame_id, *(step.parent for step in above(tree, frame_id))]
    parts = [
        f"TF from the camera up: {' < '.join(chain)}"
        + ("" if any(not s.fixed for s in above(tree, frame_id)) else ", which never moves")
    ]
    parts += [f"{step.source}: {step.parent} > {step.child}" for step in moving]
    return "; ".join(parts)


def _listed(bag: _Bag, topics: Sequence[str]) -> str:
    """Topics as text, with how many messages each has."""
    shown = [f"{topic} ({bag.counts[topic]})" for topic in topics[:LISTED]]
    return ", ".join(shown) + (f" and {len(topics) - LISTED} more" if len(topics) > LISTED else "") or "none"


def _all_topics(bag: _Bag) -> str:
    """All topics as text, with their types."""
    shown = [f"{topic} ({kind.rpartition('/')[2]})" for topic, kind in sorted(bag.topics.items())][: 2 * LISTED]
    return "topics " + ", ".join(shown) if shown else "an empty bag"
