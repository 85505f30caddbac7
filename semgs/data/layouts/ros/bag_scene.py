"""ROS bags as scenes: the images of one camera, with poses from the robot.

Images are `sensor_msgs/Image` or `CompressedImage` messages, at the time in their header; poses are interpolated to that time. Depth maps are
used if they are registered to the images, that is, in the same optical frame. 16 bits are millimetres, floats metres.
"""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import numpy as np

from semgs.data.frames import Frame
from semgs.data.layouts.parts.trajectories import associate
from semgs.data.layouts.parts.usable_frames import note_lacking
from semgs.data.layouts.ros.bag import COMPRESSED, IMAGE, Bag, BagFile, frame_id_of, open_bag
from semgs.data.layouts.ros.camera import choose_pictures, find_lens
from semgs.data.layouts.ros.image_messages import depth_fault, is_depth
from semgs.data.layouts.ros.motions import poses_along
from semgs.data.layouts.ros.route import find_route
from semgs.data.maps import MILLIMETRE, DepthMap
from semgs.data.scene import Scene
from semgs.data.scene_details import SceneDetails
from semgs.files.bags import METADATA
from semgs.files.errors import InputError
from semgs.files.images.pictures import read_header

UNSET_BEFORE = 10 * 10**9
"""If the other images were taken later than this, one with the time 0 has none: the driver did not set it [ns]."""

LAYOUT = "ROS bag"
DETAILS = ("camera", "world", "body", "intrinsics")
ENDINGS = (".mcap", ".db3", ".bag")

REALSENSE = "/file_version"
"""The topic that every recording of the RealSense SDK begins with, but none of ROS has. librealsense, src/media/ros/ros_file_format.h."""

DEPTH_TOLERANCE = 0.02
"""Largest time difference between a depth map and its image [s]."""


def recognises(path: Path) -> bool:
    """Whether a path is a bag: its folder or file."""
    if path.is_file():
        return path.suffix.lower() in ENDINGS
    try:
        with (path / METADATA).open("rb") as file:
            return b"rosbag2_bagfile_information" in file.read(4000)
    except OSError:
        return False


def open_recording(path: Path, details: SceneDetails) -> Scene:
    """The scene of a bag: the images of one camera, sorted by time.

    Args:
        path: its folder or file.
        details: camera and world, if there are several; the body of poses that do not say; other intrinsics.

    Raises:
        InputError: it is damaged, or has no images, intrinsics or poses, or several and no choice; the error lists what there is.
        ImportError: rosbags is not installed.
    """
    try:
        return _recording(path, details)
    except InputError:
        raise
    except (AttributeError, TypeError, ValueError, OverflowError) as error:
        raise InputError(path, "messages with the fields of their types", f"others: {error}") from error


def _recording(path: Path, details: SceneDetails) -> Scene:
    """As `open_recording`, but for messages whose fields are not those of their types, as a bag defines them itself."""
    bag = open_bag(path)
    if REALSENSE in bag.topics and any(topic.startswith("/device_") for topic in bag.topics):
        raise InputError(
            path, "a ROS bag with poses", "a recording of the RealSense SDK (RealSense Viewer), which has none",
            advice=f"extract its photos, rs-convert -c -i {path.name} -p PHOTOS/, and estimate cameras, semgs poses PHOTOS --out OUT; or record "
            "with the RealSense ROS wrapper and odometry",
        )  # fmt: skip
    topic = choose_pictures(bag, details.camera)
    frame = frame_id_of(bag.first(topic))
    if not frame:
        raise InputError(path, "the frame of the camera in the header of its images", "an empty frame_id", topic)
    pictures = bag.files(topic)
    repeated = bag.count(topic) - len(pictures)
    unset = len(pictures) > 1 and pictures[0].stamp == 0 and pictures[1].stamp > UNSET_BEFORE
    pictures = pictures[1:] if unset else pictures
    if repeated and len(pictures) == 1:
        found = f"{bag.count(topic)} images that all have the time {pictures[0].stamp / 1e9:.3f}"
        raise InputError(
            path, "images with the times when they were taken in their headers", found, topic,
            "the driver has to set header.stamp, or set it when the bag is converted",
        )  # fmt: skip
    lens = find_lens(bag, topic, read_header(pictures[0]).size, details)
    notes = [f"Images are from {topic}."]
    notes += [
        f"The recording {name} ends early: what is before its end is read; mcap recover repairs it." for name in bag.cut
    ]
    if repeated or unset:
        why = "the time 0 in their header, or that of another," if unset else "the same time in their header as another"
        notes.append(f"{repeated + unset} of {bag.count(topic)} images have {why} and are left out.")
    if "optical" not in frame and details.intrinsics is None:
        notes.append(
            f"The images' frame, {frame}, is not called optical; it is assumed to have x right, y down and z forward, as in REP 103."
        )
    route, about_poses = find_route(bag, frame, details)
    poses = poses_along(route, np.array([one.stamp for one in pictures], dtype=np.int64))
    posed = np.isfinite(poses).all(axis=(1, 2))
    depths, about_depth = _depths(bag, topic, frame, pictures)
    frames = tuple(
        Frame(one.name, one, lens, pose, depths.get(one))
        for one, pose, known in zip(pictures, poses, posed, strict=True)
        if known
    )
    if len(frames) < 2:
        spans = [
            f"{step.source} has {step.parent} > {step.child} {_span(step.times)}." for step in route if not step.fixed
        ]
        found = f"{len(frames)} of {len(pictures)}"
        raise InputError(
            path,
            "at least two images at times with known poses",
            found,
            topic,
            " ".join([*about_poses, *spans]),
        )
    unposed = [f"at {one.stamp / 1e9:.3f} s" for one, known in zip(pictures, posed, strict=True) if not known]
    return Scene(
        path=path,
        name=path.absolute().name if path.is_dir() else path.stem,
        layout=LAYOUT,
        unit="metric",
        frames=frames,
        notes=(
            *notes,
            *about_poses,
            *about_depth,
            *note_lacking(unposed, len(pictures), "images are at times without a known pose and are left out"),
        ),
    )


def _depths(
    bag: Bag, images: str, frame: str, pictures: Sequence[BagFile]
) -> tuple[dict[BagFile, DepthMap], list[str]]:
    """The depth map of each image that has one, and notes about depth that is not used."""
    first = {topic: bag.first(topic) for topic in bag.of(IMAGE, COMPRESSED)}
    frames = {name: frame_id_of(message) for name, message in first.items() if is_depth(message) and name != images}
    faults = {topic: depth_fault(first[topic]) for topic in frames}
    registered = [topic for topic in frames if frames[topic] == frame and not faults[topic]]
    if not registered:
        reasons = {
            topic: faults[topic] if other == frame else f"it is in the frame {other}, not registered to the images"
            for topic, other in frames.items()
        }
        return {}, [f"Depth in {topic} is left out: {reason}." for topic, reason in reasons.items()]
    topic = min(registered, key=lambda one: (bag.topics[one] == COMPRESSED, one))
    held, start = bag.files(topic), pictures[0].stamp
    seconds, others = (np.array([(one.stamp - start) / 1e9 for one in some]) for some in (pictures, held))
    pairs = associate(seconds, others, DEPTH_TOLERANCE)
    unit = 1.0 if any(one.suffix == ".npy" for one in held) else MILLIMETRE
    found = {pictures[index]: DepthMap(held[other], unit) for index, other in pairs.items()}
    missing = len(pictures) - len(found)
    return found, [
        f"{missing} of {len(pictures)} images have no depth map in {topic} at their time."
    ] if missing else []


def _span(times: np.ndarray) -> str:
    """The span of some times."""
    return f"from {times[0] / 1e9:.3f} to {times[-1] / 1e9:.3f} s"
