"""The camera of a bag: which topic has its pictures, and its lens by their `CameraInfo`.

The pixels of a `CameraInfo` have the centre of the first at (0, 0) as all that OpenCV calibrates: half a pixel is added to cx and cy. Of a
rectified picture (`rect` in its topic) P counts, of a raw one K and the distortion, which is undone.
"""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np

from semgs.data.asked import Asked
from semgs.data.layouts.parts.calibrations import asked_calibration
from semgs.data.layouts.ros.bag import COMPRESSED, IMAGE, Bag, frame_of
from semgs.data.layouts.ros.images import GREYS, encoding_of, is_depth
from semgs.data.lens import HALF, Lens
from semgs.files.errors import InputError, input_error

INFO = "sensor_msgs/msg/CameraInfo"
TRANSPORTS = ("compressed", "compressedDepth", "theora", "zstd", "ffmpeg", "raw")
"""What image_transport puts behind a topic's name."""

MODELS = ("", "plumb_bob", "none", "pinhole", "rational_polynomial")
"""Distortion models that k1, k2, p1, p2, k3 cover, where the further numbers are 0."""


def choose_pictures(bag: Bag, asked: str | None) -> str:
    """The topic of the pictures to take.

    Args:
        bag: to choose from.
        asked: the beginning of its name, if there are several cameras.

    Raises:
        InputError: there is none, or there are several cameras and nothing tells which; they are listed.
    """
    topics = bag.of(IMAGE, COMPRESSED)
    if asked is not None:
        chosen = [topic for topic in topics if topic == asked or topic.startswith(asked.rstrip("/") + "/")]
        if not chosen:
            raise InputError(bag.path, f"pictures in a topic that begins with {asked}", bag.counted(topics), "camera")
        topics = chosen
    kinds = {topic: bag.first(topic) for topic in topics}
    topics = [topic for topic in topics if not is_depth(kinds[topic])]
    if not topics:
        raise InputError(bag.path, "topics of type Image or CompressedImage", str(bag), "camera")
    coloured = [topic for topic in topics if encoding_of(kinds[topic]) not in GREYS]
    topics = coloured or topics
    names = {_name(topic) for topic in topics}
    if len({camera for camera, _ in names}) > 1 or (len(names) > 1 and not any("rect" in name for _, name in names)):
        raise InputError(bag.path, "one camera", bag.counted(topics), "camera", advice="name one: --camera TOPIC")
    # Of one camera: rectified before raw, for there is nothing to undo; uncompressed before compressed.
    return min(topics, key=lambda topic: (not _is_rectified(topic), bag.topics[topic] == COMPRESSED, topic))


def find_lens(bag: Bag, pictures: str, size: tuple[int, int], asked: Asked) -> Lens:
    """The lens of pictures.

    Args:
        bag: that they are in.
        pictures: their topic.
        size: their (height, width) [px].
        asked: may give intrinsics.

    Raises:
        InputError: there is no CameraInfo, it is for other pictures, or its lens cannot be undone.
    """
    given = asked_calibration(asked)
    if given is not None:
        return given.lens(Path(pictures), size)
    frame, wanted = frame_of(bag.first(pictures)), f"{_name(pictures)[0]}/camera_info"
    topics = [topic for topic in bag.of(INFO) if frame_of(bag.first(topic)) == frame]
    if wanted in bag.topics:
        topics = [wanted]
    if len(topics) != 1:
        raise InputError(
            bag.path, f"a CameraInfo in {wanted}, or one of the frame {frame}", bag.counted(bag.of(INFO)), pictures,
            advice="or give the intrinsics: --intrinsics fx fy cx cy",
        )  # fmt: skip
    return lens_of(bag.path, topics[0], bag.first(topics[0]), size, rectified=_is_rectified(pictures))


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
        wanted = f"a CameraInfo for {size[1]}x{size[0]} pixels (width x height), as the pictures are"
        raise InputError(path, wanted, f"{width}x{height}", topic)
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
    with input_error(path, "a camera that can be", topic):
        return Lens(size, focal, (float(centre[0]), float(centre[1])), distortion)


def _name(topic: str) -> tuple[str, str]:
    """The camera that an image topic is of, and the last part of its name, without what image_transport puts behind it."""
    head, _, tail = topic.rpartition("/")
    camera, _, name = (head if tail in TRANSPORTS else topic).rpartition("/")
    return camera, name


def _is_rectified(topic: str) -> bool:
    """Whether pictures are without distortion by their topic's name."""
    return "rect" in _name(topic)[1]
