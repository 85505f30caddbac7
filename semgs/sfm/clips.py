"""Frames of a clip: sharp ones, with motion between them."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from itertools import count, islice, takewhile
from pathlib import Path

import cv2
import numpy as np

from semgs.files.atomic import write_bytes
from semgs.files.errors import InputError
from semgs.files.images.pictures import MOST_PIXELS, jpeg_bytes
from semgs.files.paths import check_utf8
from semgs.runtime.notes import Kind
from semgs.sfm.clip_headers import (
    check_clip_size,
    check_container,
    is_mirrored,
    limit_frames,
    only_this_file,
    read_clip_sizes,
)
from semgs.sfm.photos import BLANK, QUALITY, PhotoSet, UprightPhoto, is_panorama, sharpness_of, small_grey

MIRRORED = "The clip's header says that it is mirrored; its frames were mirrored, as players show them."
CHOSEN = Kind("{chosen} of {count} frames of the clip were chosen: sharp ones, with motion between them.{times}", "")

MOST_JUDGED = 900
"""Of longer clips, every n-th frame is judged."""

MOST_FRAMES = 108_000
"""Longer clips are refused: an hour with 30 frames a second."""

LEAST_MOTION = 0.02
"""Frames whose picture moved less than this since the last chosen one are left out [share of the longer side]."""

UNEVEN = 1.6
"""If a frame is shown this many times as long as another, times are uneven; those that are rounded to milliseconds stay far below."""

CORNERS, TRACKED = 200, 0.3
"""Corners that are followed from one frame to the next. If fewer than this share can be followed, the picture has moved enough."""

NEARLY_SQUARE = 0.005
"""Pixels whose sides differ by no more than this share, as encoders write to round a size, count as square."""

LONGEST_PIXEL = 4
"""Clips whose pixels are longer than so many times their other side are refused; television has at most 2."""

MOVING = 0.2
"""This share of the corners has to move: when you walk around something, most of the picture stays where it is."""


@dataclass(frozen=True, eq=False)
class Judged:
    """A frame of a clip.

    Attributes:
        index: its position in the clip.
        grey: the small picture.
        sharpness: variance of the Laplacian; 0 for black and blank frames.
        seconds: when it is shown; 0 if the clip does not say.
    """

    index: int
    grey: np.ndarray
    sharpness: float
    seconds: float = 0.0


@dataclass(frozen=True)
class Thumbnail:
    """The first video stream of a clip, which OpenCV decodes, if another has much larger frames.

    Attributes:
        size: width and height, for messages.
        of_clip: those of the largest stream.
        remedy: a command that keeps only the largest stream.
    """

    size: str
    of_clip: str
    remedy: str


def copy_frames(path: Path, folder: Path, most: int) -> PhotoSet:
    """Write the frames to use of a clip as JPEGs, turned and mirrored as its header says, and stretched to square pixels.

    Args:
        path: the clip.
        folder: an existing, empty one.
        most: the largest number of frames.

    Raises:
        InputError: it has another format, it cannot be decoded, its path is not UTF-8, its frames are larger than `MOST_PIXELS` or more than `MOST_FRAMES`, its pixels
            are longer than `LONGEST_PIXEL`, or fewer than two frames are sharp with motion between them.
        OSError: a frame cannot be written.
    """
    check_utf8(path, "OpenCV")
    check_container(path)
    judged = list(_judged(path))
    usable = [one for one in judged if one.sharpness > 0]
    uneven = has_uneven_times(judged)
    chosen = moving(sharpest(usable, most, uneven)) if usable else []
    if len(chosen) < 2 and (thumbnail := _thumbnail(path)) is not None:
        page = f"its first video stream is a picture of {thumbnail.size}, and its frames are in another. Convert it to H.264 in MP4"
        raise InputError(
            path, "a video whose first stream has its frames",
            f"a thumbnail of {thumbnail.size} there and the frames of {thumbnail.of_clip} behind it", advice=f"remove it: {thumbnail.remedy}", page=page,
        )  # fmt: skip
    if not judged:
        advice = "convert it to H.264 in MP4"
        page = "it cannot be decoded. Convert it to H.264 in MP4"
        raise InputError(path, "a video that OpenCV can decode", "no frames", advice=advice, page=page)
    if not usable:
        raise InputError(path, "a video with pictures", f"{len(judged)} black or blank frames")
    if len(chosen) < 2:
        advice = "walk sideways past the scene while filming; turning on the spot does not help"
        raise InputError(
            path, "a video in which the camera moves", f"the same picture in {len(judged)} frames", advice=advice
        )
    wanted, photos = {one.index for one in chosen}, list[UprightPhoto]()
    for index, _, pixels in _frames(path, 1):
        if index in wanted:
            if not photos and is_panorama(pixels):
                raise InputError(
                    path,
                    "a video of a usual camera",
                    "panoramas",
                    advice="film with one lens; a panorama has no pinhole camera",
                )
            name = f"frame_{index:05d}.jpg"
            write_bytes(folder / name, jpeg_bytes(pixels, QUALITY))
            photos.append(UprightPhoto(name, (pixels.shape[0], pixels.shape[1])))
        if index >= max(wanted):
            break
    uneven_times = " It has frames at uneven times; they are spread by time." if uneven else ""
    note = CHOSEN(chosen=len(photos), count=len(judged), times=uneven_times)
    return PhotoSet(path, folder, tuple(photos), ordered=True, notes=(note, *_notes_on_shape(path)))


def sharpest(frames: list[Judged], most: int, by_time: bool = False) -> list[Judged]:
    """The sharpest frame of each of at most `most` equal stretches of a clip: with as many frames, or equally long."""
    parts = np.array_split(np.arange(len(frames)), min(most, len(frames)))
    if by_time and len(frames) > 1:
        seconds = np.array([one.seconds for one in frames])
        stretch = ((seconds - seconds[0]) / (seconds[-1] - seconds[0]) * most).astype(int).clip(max=most - 1)
        parts = [np.flatnonzero(stretch == place) for place in np.unique(stretch)]
    return [max((frames[index] for index in part), key=lambda one: one.sharpness) for part in parts]


def has_uneven_times(frames: list[Judged]) -> bool:
    """Whether some frames are shown much longer than others, as in clips of a variable frame rate; not if the clip says no times."""
    gaps = np.diff([one.seconds for one in frames])
    return len(gaps) > 1 and bool(gaps.min() > 0 and gaps.max() > UNEVEN * gaps.min())


def moving(frames: list[Judged]) -> list[Judged]:
    """The frames without those that show nearly the same picture as the last one that was kept."""
    kept = frames[:1]
    for one in frames[1:]:
        if measure_motion(kept[-1].grey, one.grey) >= LEAST_MOTION:
            kept.append(one)
    return kept


def measure_motion(first: np.ndarray, second: np.ndarray) -> float:
    """By how much a share `MOVING` of the corners moved at least between two frames in grey [share of the longer side]; infinite if they are lost."""
    corners = cv2.goodFeaturesToTrack(first, CORNERS, 0.01, 5)
    if corners is None:
        return 0.0
    there, found, _ = cv2.calcOpticalFlowPyrLK(first, second, corners, None)  # type: ignore[call-overload]
    found = found.ravel() == 1
    if found.mean() < TRACKED:
        return np.inf
    return float(np.quantile(np.linalg.norm((there - corners)[found, 0], axis=1), 1 - MOVING) / max(first.shape))


def _judged(path: Path) -> Iterator[Judged]:
    """The frames of a clip to choose from: fewer than `2 * MOST_JUDGED`, also if its header says that it has fewer than it has."""
    for index, seconds, pixels in islice(_frames(path, max(1, _count_frames(path) // MOST_JUDGED)), 2 * MOST_JUDGED):
        grey = small_grey(pixels)
        yield Judged(index, grey, sharpness_of(grey) if grey.std() >= BLANK else 0.0, seconds)


def _count_frames(path: Path) -> int:
    """The number of frames of a clip. If its file does not say, as recordings of browsers (WebM) do not, they are counted."""
    video = _opened(path)
    try:
        stated = int(video.get(cv2.CAP_PROP_FRAME_COUNT))
        return stated if stated > 0 else sum(1 for _ in islice(iter(video.grab, False), MOST_FRAMES))
    finally:
        video.release()


def _frames(path: Path, step: int) -> Iterator[tuple[int, float, np.ndarray]]:
    """Every `step`-th frame of a clip with its position and time [s], RGB, upright."""
    video = _opened(path)
    try:
        across, down = _stretch(path, video)
        mirrored = is_mirrored(path)
        for index in takewhile(lambda _: video.grab(), count()):
            if index >= MOST_FRAMES:
                raise InputError(path, f"a clip of at most {MOST_FRAMES:,} frames", "more", advice="cut it")
            if index % step == 0:
                good, pixels = video.retrieve()
                if not good:  # a frame that became too large on the way; those behind it would be as large
                    break
                if mirrored:  # OpenCV has turned the frame, by 180 degrees in place of a mirroring left to right
                    pixels = cv2.flip(pixels, int(video.get(cv2.CAP_PROP_ORIENTATION_META) % 180 > 0))
                if across != down:
                    pixels = cv2.resize(pixels, None, fx=across, fy=down, interpolation=cv2.INTER_LINEAR)
                yield index, video.get(cv2.CAP_PROP_POS_MSEC) / 1000, cv2.cvtColor(pixels, cv2.COLOR_BGR2RGB)
    finally:
        video.release()


def _stretch(path: Path, video: cv2.VideoCapture) -> tuple[float, float]:
    """By how much upright frames become wider and higher so that their pixels are square: (1, 1) if they are, or the clip does not say.

    Raises:
        InputError: pixels are longer than `LONGEST_PIXEL`, or stretched frames larger than `MOST_PIXELS`.
    """
    wide, high = video.get(cv2.CAP_PROP_SAR_NUM), video.get(cv2.CAP_PROP_SAR_DEN)
    if wide <= 0 or high <= 0 or abs(wide / high - 1) <= NEARLY_SQUARE:
        return 1, 1
    if max(wide, high) > LONGEST_PIXEL * min(wide, high):
        raise InputError(path, f"pixels at most {LONGEST_PIXEL} times as long as wide", f"{wide:.0f}:{high:.0f}")
    if video.get(cv2.CAP_PROP_ORIENTATION_META) % 180:  # the ratio is that of frames as they are stored
        wide, high = high, wide
    across, down = max(wide / high, 1), max(high / wide, 1)
    width, height = (video.get(one) for one in (cv2.CAP_PROP_FRAME_WIDTH, cv2.CAP_PROP_FRAME_HEIGHT))
    if width * across * height * down > MOST_PIXELS:
        size = f"{width * across:.0f}x{height * down:.0f}"
        raise InputError(path, f"frames of at most {MOST_PIXELS:,} pixels", f"{size} with square pixels")
    return across, down


def _notes_on_shape(path: Path) -> Iterator[str]:
    """That frames are mirrored or stretched, if they are."""
    if is_mirrored(path):
        yield MIRRORED
    if (thumbnail := _thumbnail(path)) is not None:
        yield (
            f"The clip has several video streams; the first, of {thumbnail.size}, was read, not that of {thumbnail.of_clip}. "
            f"To use that: {thumbnail.remedy}"
        )
    video = _opened(path)
    try:
        across, down = _stretch(path, video)
        width, height = (video.get(one) for one in (cv2.CAP_PROP_FRAME_WIDTH, cv2.CAP_PROP_FRAME_HEIGHT))
    finally:
        video.release()
    if across != down:
        sizes = f"from {width:.0f}x{height:.0f} to {width * across:.0f}x{height * down:.0f}"
        yield f"The clip's pixels are not square; its frames were stretched {sizes}, as players show them."


def _thumbnail(path: Path) -> Thumbnail | None:
    """What OpenCV decodes in place of the frames of a clip; None if these are the largest that its header announces, up to a factor of 2 in pixels."""
    sizes = read_clip_sizes(path)
    video = _opened(path)
    try:
        width, height = (int(video.get(one)) for one in (cv2.CAP_PROP_FRAME_WIDTH, cv2.CAP_PROP_FRAME_HEIGHT))
    finally:
        video.release()
    largest = max(sizes, key=lambda size: size[0] * size[1], default=(0, 0))
    if min(width, height) < 1 or largest[0] * largest[1] < 2 * width * height:
        return None
    # A cover is no track, so it has no size in the header; FFmpeg's V leaves it out.
    is_track = (height, width) in sizes or (width, height) in sizes
    stream = f"0:v:{sizes.index(largest)}" if is_track else "0:V"
    remedy = f"ffmpeg -i {path.name} -map {stream} -c copy converted{path.suffix}"
    return Thumbnail(f"{width}x{height}", f"{largest[1]}x{largest[0]}", remedy)


def _opened(path: Path) -> cv2.VideoCapture:
    """A clip, opened; its rotation flag is applied to the frames.

    Raises:
        InputError: its frames are larger than `MOST_PIXELS`.
    """
    check_clip_size(path)
    limit_frames(MOST_PIXELS)
    with only_this_file():
        video = cv2.VideoCapture(str(path.absolute()), cv2.CAP_FFMPEG)
    # What the frames themselves say may differ from what the container announced.
    width, height = (int(video.get(one)) for one in (cv2.CAP_PROP_FRAME_WIDTH, cv2.CAP_PROP_FRAME_HEIGHT))
    if width * height > MOST_PIXELS:
        video.release()
        raise InputError(path, f"frames of at most {MOST_PIXELS:,} pixels", f"{width}x{height}")
    limit_frames(width * height or MOST_PIXELS)  # frames may not grow on the way
    video.set(cv2.CAP_PROP_ORIENTATION_AUTO, 1)
    return video
