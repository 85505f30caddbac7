"""Streams: a scene that grows while frames arrive."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from math import inf, isnan
from time import perf_counter
from typing import Any
from zlib import crc32

import torch
from jaxtyping import Int64
from torch import Tensor

from semgs.data.bounds.depth_range import DepthRange
from semgs.data.resampling import default_size, reframed
from semgs.data.views import INDOOR_DEPTH_RANGE, Views
from semgs.geometry.cameras import Arrays, Cameras
from semgs.geometry.gaussians import Gaussians
from semgs.mapping.mapper import Mapper, Merged
from semgs.model.classes.view_cache import ViewCache
from semgs.model.encode import Network, encode
from semgs.model.weights.load import load
from semgs.rendering.rendering import Rendering
from semgs.scene.encoding import Encoding
from semgs.scene.scene_file import SavedScene

VOXEL = 0.003
"""Gaussians in the same voxel of this size are joined [m]."""

StreamedFrame = Sequence[Arrays | float]
"""An image, its pose and its intrinsics, and optionally its time [s]; as for `stream`."""


@dataclass(frozen=True)
class StreamedScene:
    """The scene after one more window.

    Attributes:
        gaussians: of the scene so far, for `semgs.render`, `semgs.save_ply` and `semgs.objects`.
        encoding: the same, with depth, confidence and spread of the keyframes.
        views: the keyframes.
        frame: number of the latest frame, from 0.
        names: numbers of the keyframes, as text.
        ignored: how many frames were left out so far, by reason.
        resized: how many frames had another size than the first one.
        seconds: from the latest frame to this scene.
    """

    encoding: Encoding
    views: Views
    frame: int
    names: tuple[str, ...]
    ignored: Mapping[str, int]
    resized: int
    seconds: float

    @property
    def gaussians(self) -> Gaussians:
        """The Gaussians of the scene so far."""
        return self.encoding.gaussians

    @cached_property
    def sources(self) -> Int64[Tensor, " g"]:
        """A number for each Gaussian that it keeps while the scene grows: its photo's checksum and its place there. For `semgs.Ids`."""
        rows, columns = self.encoding.grid
        photos = torch.tensor([crc32(image.numpy().tobytes()) for image in self.views.images])
        return (photos[self.encoding.own_views] << 31) + self.encoding.blocks % (rows * columns)

    def render(self, cameras: Cameras, **options) -> Rendering:
        """Render from cameras; arguments and errors as for `Encoding.render`."""
        return self.encoding.render(cameras, **options)

    @cached_property
    def saved(self) -> SavedScene:
        """The scene for `semgs.save_scene`. Lengths are taken as metres."""
        return SavedScene.of(self.encoding, self.views, unit="metric", frames=self.names, source="stream")


def stream(
    frames: Iterable[StreamedFrame],
    network: str | Network = "small",
    *,
    depth_range: tuple[float, float] = INDOOR_DEPTH_RANGE,
    size: tuple[int, int] | None = None,
    views: int = 2,
    radius: float | None = None,
    voxel: float | None = VOXEL,
) -> Iterator[StreamedScene]:
    """Build one scene from posed frames, as they come: yields the scene each time that a window of keyframes was added to it.

        for scene in semgs.stream(frames):
            picture = scene.render(camera).images[0]

    A frame becomes a keyframe if it shows enough that is new. It is encoded together with the best earlier keyframes, and merged with what is there. No
    frame is read before the one before it was dealt with. Frames that cannot be used are counted in `ignored`, and the next one is taken.

    Args:
        frames: (image, world_from_camera, intrinsics), or with the time in seconds as a fourth. Images are [h w 3] uint8 or [3 h w] float in 0..1; poses
            [4 4] are camera to world, OpenCV axes [m]; intrinsics [3 3] are in pixels. Lens distortion must be undone.
        network: a name or file, as for `semgs.load`, or a network.
        depth_range: near and far [m].
        size: (height, width) to resize to; None is `semgs reconstruct`'s size for the first frame, at most 76,800 pixels. Other aspect ratios are cropped.
        views: of a window, 2 to 4.
        radius: keep Gaussians within this distance of the latest keyframe only, and so bound memory; None keeps all [m].
        voxel: Gaussians in the same voxel of this size are joined; None joins none [m].

    Raises:
        ValueError: an argument is outside its range, a frame has neither three nor four parts, or all frames have ended and none could be used, because
            its time, image, pose or intrinsics were not valid, or because all that was seen was farther away than `radius`.
    """
    if not isinstance(frames, Iterable):
        raise TypeError(
            f"frames are {type(frames).__name__}; expected (image, world_from_camera, intrinsics) again and again, as they come"
        )
    near, far = depth_range
    if not 0 < near < far < inf:
        raise ValueError(f"depth_range is {depth_range}; expected near and far in metres, 0 < near < far")
    model = load(network) if isinstance(network, str) else network
    bounds = DepthRange(near, far, "metric", "as given")

    cache = ViewCache()

    def window(_: Sequence[int], seen: Views) -> Encoding:
        return encode(model, seen, cache=cache).encoding

    mapper = Mapper(window, bounds, views=views, radius=radius, voxel=voxel)
    reader = FrameReader((near, far), size)
    valid = scenes = 0
    for frame in frames:
        start = perf_counter()
        view = reader.read(frame, mapper.ignore)
        valid += view is not None
        with torch.no_grad():
            if view is None or not mapper.add(view):
                continue
            merged = mapper.merged()
        if merged is not None:
            scenes += 1
            yield _scene(merged, mapper, reader.resized, perf_counter() - start)
    if mapper.ignored and not valid:
        reasons = ", ".join(f"{reason} ({count})" for reason, count in mapper.ignored.items())
        first = f"; the first: {reader.first_error}" if reader.first_error else ""
        raise ValueError(f"no frame could be used: {reasons}{first}")
    if mapper.windows and not scenes:
        raise ValueError(
            f"radius is {radius}; expected more, or None: everything was farther than that from the latest keyframe"
        )


class FrameReader:
    """Turns a stream's frames into views of one size.

    Args:
        depth_range: near and far [m].
        size: (height, width) of the views; None is decided by the first frame.

    Attributes:
        resized: how many frames had another size than the first one.
        first_error: what is wrong with the first frame whose image, pose or intrinsics are not valid; empty if there is none.
    """

    def __init__(self, depth_range: tuple[float, float], size: tuple[int, int] | None) -> None:
        self._depth_range, self._size = depth_range, size
        self._first: tuple[int, int] | None = None
        self._time = float("-inf")
        self.resized, self.first_error = 0, ""

    def read(self, frame: StreamedFrame, ignore: Callable[[str], None]) -> Views | None:
        """A frame as one view; None, after `ignore` was called with the reason, if it cannot be used.

        Raises:
            ValueError: it has neither three nor four parts.
        """
        if not isinstance(frame, Sequence) or isinstance(frame, str):
            raise TypeError(
                f"a frame is {type(frame).__name__}; expected image, pose and intrinsics, and perhaps its time"
            )
        if len(frame) not in (3, 4):
            raise ValueError(
                f"a frame has {len(frame)} parts; expected image, pose and intrinsics, and perhaps its time"
            )
        image, pose, intrinsics = frame[:3]
        if len(frame) == 4:
            before, self._time = self._time, _seconds(frame[3])
            if isnan(self._time) or self._time <= before:
                ignore("its time is not later than the one before")
                return None
        try:
            view = Views.from_arrays([image], [pose], intrinsics, self._depth_range)  # type: ignore[list-item, arg-type]
        except (ValueError, TypeError, RuntimeError) as error:
            self.first_error = self.first_error or str(error)
            ignore("its image, pose or intrinsics are not valid")
            return None
        if self._first is None:
            self._first = view.size
            self._size = self._size or default_size(view.size)
        self.resized += view.size != self._first
        return view if view.size == self._size else reframed(view, self._size or view.size)


def _seconds(time: Any) -> float:
    """A frame's time.

    Raises:
        TypeError: it is no number.
    """
    try:
        return float(time)
    except (TypeError, ValueError) as error:
        raise TypeError(
            f"a frame's time is {time!r:.60} ({type(time).__name__}); expected seconds, or a frame of three parts"
        ) from error


def _scene(merged: Merged, mapper: Mapper, resized: int, seconds: float) -> StreamedScene:
    """What is yielded."""
    return StreamedScene(
        encoding=merged.encoding,
        views=merged.views,
        frame=mapper.frames - 1,
        names=merged.names,
        ignored=dict(mapper.ignored),
        resized=resized,
        seconds=seconds,
    )
