"""The camera of a bag: the topic of its images, and the lens from their `CameraInfo`.

A `CameraInfo` has the centre of the first pixel at (0, 0), like OpenCV's calibration, so half a pixel is added to cx and cy. For
rectified images (`rect` in the topic) P is used; for raw ones K, and the distortion, which is undone.
"""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np

from semgs.data.cameras.lens import HALF, Lens
from semgs.data.layouts.parts.calibrations import calibration_from_details
from semgs.data.layouts.ros.bag import COMPRESSED, IMAGE, Bag, frame_id_of
from semgs.data.layouts.ros.image_messages import GREYS, encoding_of, is_depth
from semgs.data.scene_details import SceneDetails
from semgs.files.errors import InputError, input_error

INFO = "sensor_msgs/msg/CameraInfo"
TRANSPORTS = ("compressed", "compressedDepth", "theora", "zstd", "ffmpeg", "raw")
"""What image_transport appends to the name of a topic."""

MODELS = ("", "plumb_bob", "none", "pinhole", "rational_polynomial")
"""Distortion models covered by k1, k2, p1, p2, k3, if all further coefficients are 0."""


def choose_pictures(bag: Bag, prefix: str | None) -> str:
    """The topic of the images to use.

    Args:
        bag: to choose from.
        prefix: topic prefix of the camera, needed if there are several.

    Raises:
        InputError: there are no images, or several cameras and no choice; the error lists them.
    """
    topics = bag.of(IMAGE, COMPRESSED)
    if prefix is not None:
        chosen = [topic for topic in topics if topic == prefix or topic.startswith(prefix.rstrip("/") + "/")]
        if not chosen:
            raise InputError(bag.path, f"images in a topic that begins with {prefix}", bag.counted(topics), "camera")
        topics = chosen
    kinds = {topic: bag.first(topic) for topic in topics}
    infrared = [topic for topic in topics if encoding_of(kinds[topic]) == "mono16" and "depth" not in topic]
    topics = [topic for topic in topics if not is_depth(kinds[topic])] or infrared
    if not topics:
        raise InputError(bag.path, "topics of type Image or CompressedImage", str(bag), "camera")
    coloured = [topic for topic in topics if encoding_of(kinds[topic]) not in GREYS]
    topics = coloured or topics
    names = {_name(topic) for topic in topics}
    if len({camera for camera, _ in names}) > 1 or (len(names) > 1 and not any("rect" in name for _, name in names)):
        raise InputError(bag.path, "one camera", bag.counted(topics), "camera", advice="choose one: --camera TOPIC")
    # Prefer rectified images, which need no undistortion, and uncompressed ones.
    return min(topics, key=lambda topic: (not _is_rectified(topic), bag.topics[topic] == COMPRESSED, topic))


def find_lens(bag: Bag, pictures: str, size: tuple[int, int], details: SceneDetails) -> Lens:
    """The lens of images.

    Args:
        bag: that contains them.
        pictures: their topic.
        size: their (height, width) [px].
        details: may give intrinsics.

    Raises:
        InputError: there is no CameraInfo, it is for other images, or its distortion is not supported.
    """
    given = calibration_from_details(details)
    if given is not None:
        return given.lens(Path(pictures), size)
    frame, wanted = frame_id_of(bag.first(pictures)), f"{_name(pictures)[0]}/camera_info"
    topics = [topic for topic in bag.of(INFO) if frame_id_of(bag.first(topic)) == frame]
    if wanted in bag.topics:
        topics = [wanted]
    if len(topics) != 1:
        raise InputError(
            bag.path, f"a CameraInfo in {wanted}, or one of the frame {frame}", bag.counted(bag.of(INFO)), pictures,
            advice="or give the intrinsics: --intrinsics fx fy cx cy",
        )  # fmt: skip
    return lens_of(bag.path, topics[0], bag.first(topics[0]), size, rectified=_is_rectified(pictures))


def lens_of(path: Path, topic: str, info: Any, size: tuple[int, int], *, rectified: bool) -> Lens:
    """The lens from a CameraInfo.

    K and P are for the full sensor; binning and the region of interest are applied here. https://docs.ros.org/en/rolling/p/sensor_msgs

    Raises:
        InputError: it is for other images or not calibrated, or has a distortion beyond k1, k2, p1, p2, k3.
    """
    k, d, p = (
        np.asarray(getattr(info, name, None) if hasattr(info, name) else getattr(info, name.upper())) for name in "kdp"
    )
    projected = rectified and (p[:1].any() or np.any(d))  # some drivers leave P empty
    matrix = p.reshape(3, 4)[:, :3] if projected else k.reshape(3, 3)
    finite = bool(np.isfinite(matrix).all())
    if not (finite and matrix[0, 0] > 0):
        used = "P, the matrix of rectified images" if projected else "K, the matrix of raw images"
        found = f"{'a focal length of zero' if finite else 'NaN or infinity'} in {used}"
        advice = "or give the intrinsics: --intrinsics fx fy cx cy"
        raise InputError(path, "a calibrated camera", found, topic, advice)
    bins = max(1, int(info.binning_x)), max(1, int(info.binning_y))
    roi = info.roi
    full = not (roi.width and roi.height)
    width, height = (int(info.width), int(info.height)) if full else (int(roi.width), int(roi.height))
    if (height // bins[1], width // bins[0]) != size and size != (height, width):
        wanted = f"a CameraInfo for {size[1]}x{size[0]} pixels (width x height), the size of the images"
        advice = "or give the intrinsics of the images: --intrinsics fx fy cx cy"
        raise InputError(path, wanted, f"{width}x{height}", topic, advice)
    if size == (height, width):
        bins = 1, 1
    x, y = (0, 0) if full else (int(roi.x_offset), int(roi.y_offset))
    centre = (matrix[0, 2] + HALF - x) / bins[0], (matrix[1, 2] + HALF - y) / bins[1]
    focal = float(matrix[0, 0] / bins[0]), float(matrix[1, 1] / bins[1])
    if rectified or not np.any(d):
        distortion = (0.0, 0.0, 0.0, 0.0, 0.0)
    elif str(info.distortion_model) in MODELS and not np.any(d[5:]):
        distortion = tuple(float(value) for value in [*d[:5], *[0.0] * 5][:5])  # type: ignore[assignment]
    else:
        raise InputError(
            path, "a lens of plumb_bob with k1, k2, p1, p2, k3", f"{info.distortion_model} with {d.tolist()}", topic,
            advice="record rectified images (image_proc), or give the intrinsics of undistorted ones",
        )  # fmt: skip
    with input_error(path, "a possible camera", topic):
        return Lens(size, focal, (float(centre[0]), float(centre[1])), distortion)


def _name(topic: str) -> tuple[str, str]:
    """The camera of an image topic, and the last part of its name, without what image_transport appends."""
    head, _, tail = topic.rpartition("/")
    camera, _, name = (head if tail in TRANSPORTS else topic).rpartition("/")
    return camera, name


def _is_rectified(topic: str) -> bool:
    """Whether images are undistorted, by the name of their topic."""
    return "rect" in _name(topic)[1]
