"""A scene on disk: its frames with their cameras, read on demand."""

from __future__ import annotations

import operator
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from pathlib import Path, PurePosixPath, PureWindowsPath
from typing import Literal

import numpy as np

from semgs.data.bounds.depth_range import DepthRange, depth_range
from semgs.data.bounds.parallax import FrameFeatures
from semgs.data.confined import may_read
from semgs.data.frames import Frame
from semgs.data.maps import Pixels
from semgs.data.origin.terms import Labeller
from semgs.data.resampling import Fit, default_size
from semgs.data.spread import spread
from semgs.data.tables.classes import ClassTable
from semgs.data.views import FAR_OUT, INDOOR_DEPTH_RANGE, Views, joined
from semgs.files.errors import InputError, input_error
from semgs.files.images.notebook import MOST, Strip, html, subsample
from semgs.files.paths import not_hidden
from semgs.files.text import counted, natural_order
from semgs.geometry.cameras import Cameras
from semgs.geometry.summaries import describe


@dataclass(frozen=True, eq=False)
class Scene:
    """A scene of posed images. Only headers have been read.

    A frame's position counts the usable frames in file order, from 0. Poses and `points` are those of the files. If the scene is far from
    the origin of its coordinates, views have `origin` subtracted.

    Attributes:
        path: the file or folder that describes the scene.
        name: the name of its folder.
        layout: the detected layout: "transforms.json", "COLMAP", "ScanNet", "ScanNet++ dslr", ...
        unit: of lengths: "metric" or "unknown".
        unit_source: why lengths are metres, as a sentence without its beginning ("the file says so"); "" if they are not, or if all scenes of the
            layout are.
        frames: the usable frames.
        classes: the class table of the labels; None if there are no labels or they cannot be read.
        unread_labels: why existing labels cannot be read: their table is unknown or damaged. None otherwise.
        absent: names of listed frames whose images are missing.
        notes: what the user should know.
        points: sparse points [n 3] in the world, or None.
        applied_transform: nerfstudio's [3 4], from the original world to that of the poses, which is ours; or None.
        applied_scale: nerfstudio's scale between the two, or None.
        splits: positions of the frames in each split of the data set ("train", "test").
        labeller: the network that the labels are from; None for the labels of the scene's files.
        posed: whether the cameras are known. If not, each image stands alone: intrinsics and poses are placeholders.
        stated_range: near and far that the user states for all frames; None to find them.
    """

    path: Path
    name: str
    layout: str
    unit: str
    frames: tuple[Frame, ...]
    classes: ClassTable | None = None
    unread_labels: InputError | None = None
    absent: tuple[str, ...] = ()
    notes: tuple[str, ...] = ()
    points: np.ndarray | None = field(default=None, repr=False)
    applied_transform: np.ndarray | None = None
    applied_scale: float | None = None
    splits: Mapping[str, tuple[int, ...]] = field(default_factory=dict)
    labeller: Labeller | None = None
    posed: bool = True
    unit_source: str = ""
    stated_range: DepthRange | None = None

    def __post_init__(self) -> None:
        if len(self.frames) < 2 and self.posed:
            listed = len(self.frames) + len(self.absent)
            raise InputError(
                self.path,
                "at least two usable frames",
                f"{len(self.frames)} ({listed} listed, {len(self.absent)} without their image)",
                advice=f"the first missing one is {self.absent[0]}{_of_elsewhere(self.absent[0]) or _beside(self.path, self.absent[0])}"
                if self.absent
                else None,
            )

    def __repr__(self) -> str:
        sizes = sorted({frame.lens.size for frame in self.frames})
        return describe(
            "Scene",
            name=self.name,
            path=self.path,
            layout=self.layout,
            unit=self.unit,
            frames=f"{len(self)} of {', '.join(f'{height}x{width}' for height, width in sizes[:MOST])} (height x width)",
            classes=self.classes and f"{self.classes.name}, {len(self.classes)} classes",
            absent=f"{len(self.absent)} listed frames without their image" if self.absent else None,
            points=None if self.points is None else len(self.points),
            splits=", ".join(f"{name} {len(part)}" for name, part in self.splits.items()) or None,
            notes=" ".join(self.notes) or None,
        )

    def _repr_html_(self) -> str:
        """A few of the images for a notebook, or why they cannot be read."""
        images, captions = [], []
        for index in spread(range(len(self)), MOST):
            frame = self.frames[index]
            try:
                images.append(subsample(frame.read_image()))
                captions.append(f"{index}: {frame.name}")
            except InputError as error:
                captions.append(f"{index}: {error}")
        return html(repr(self), [Strip("frames", tuple(images), ", ".join(captions))])

    def __len__(self) -> int:
        """The number of usable frames."""
        return len(self.frames)

    @property
    def places(self) -> set[Path]:
        """What the scene is read from: the file or folder that describes it, and the folders of its images."""
        return {self.path, *(frame.picture.parent for frame in self.frames if isinstance(frame.picture, Path))}

    @property
    def cameras(self) -> list[Cameras]:
        """The camera of each frame, at full size, after undistortion."""
        return [frame.camera for frame in self.frames]

    @cached_property
    def origin(self) -> np.ndarray:
        """The point [3] of the scene's coordinates that becomes the origin of the views.

        It is (0, 0, 0), unless the cameras are further than `FAR_OUT` from there along an axis (UTM, ECEF). Then it is in the middle of
        the cameras, rounded to whole units, so that subtracting and adding it are exact in float64.
        """
        centres = np.sort([frame.world_from_camera[:3, 3] for frame in self.frames], axis=0)
        middle = centres[len(centres) // 2]
        return np.rint(middle) if np.abs(middle).max() > FAR_OUT else np.zeros(3)

    def local(self, views: Views) -> Views:
        """Views with the poses of the files, moved to the world around `origin`."""
        return views.changed(cameras=views.cameras.relative_to(self.origin)) if self.origin.any() else views

    def with_readable_labels(self, positions: Sequence[int]) -> Scene:
        """This scene without labels, and a note why, if those of some frames cannot be read from their files; else this scene."""
        for position in positions if self.classes is not None else ():
            frame = self.frames[position]
            try:
                if frame.labels is not None and frame.labels.stored:
                    frame.labels.read(Pixels(frame.lens, frame.camera))
            except InputError as error:
                note = f"The labels are left out: {error}."
                return replace(self, classes=None, unread_labels=error, notes=(*self.notes, note))
        return self

    def index(self, frame: int | str) -> int:
        """The position of a frame, given its position or name (as listed, the file name, or the stem).

        Raises:
            ValueError: no frame has that position or name, or several have that name.
        """
        if isinstance(frame, str):
            wanted = frame.replace("\\", "/").removeprefix("./")
            for key in (lambda name: name, lambda name: Path(name).name, lambda name: Path(name).stem):
                matches = [index for index, candidate in enumerate(self.frames) if key(candidate.name) == wanted]
                if len(matches) > 1:
                    raise ValueError(
                        f"frame {frame!r} may be {self.frames[matches[0]].name} or {self.frames[matches[1]].name} "
                        f"of {self.path}; give the full name or the position"
                    )
                if matches:
                    return matches[0]
            reason = ", its image is missing" if wanted in {Path(name).name for name in self.absent} else ""
            raise ValueError(f"{self.path} has no usable frame {frame!r}{reason}; the first is {self.frames[0].name}")
        if isinstance(frame, bool | np.bool_):
            raise TypeError("frames are true and false; expected positions or names, such as np.flatnonzero(mask)")
        if not isinstance(frame, int | np.integer):
            raise TypeError(f"a frame is {type(frame).__name__}; expected its position or name")
        position = operator.index(frame)
        if not 0 <= position < len(self.frames):
            raise ValueError(
                f"{self.path} has no frame {frame}; expected a position from 0 to {len(self.frames) - 1} among the usable frames"
            )
        return position

    def depth_range(
        self,
        frames: Sequence[int | str] | None = None,
        features: dict[int, FrameFeatures] | None = None,
        *,
        stated: bool = False,
    ) -> DepthRange:
        """Near and far for some frames, with the reason: those that the user states, or else what fits the frames.

        Args:
            frames: positions or names; None for all.
            features: known features by frame position, to reuse them between calls; new ones are added.
            stated: take the range of rooms for metric scenes without comparing it with what the images show, as protocols do.

        Raises:
            ValueError: no frame has that position or name, or the list is empty or has one twice.
            InputError: the scale has to be found from images, and one cannot be read.
        """
        if self.stated_range is not None:
            return self.stated_range
        if not self.posed:
            return DepthRange(*INDOOR_DEPTH_RANGE, self.unit, "the range of rooms, as the cameras are unknown")
        return depth_range(self.frames, self._positions(frames), self.unit, self.points, features, stated=stated)

    def _positions(self, frames: Iterable[int | str] | None) -> Sequence[int]:
        """The positions of frames; None for all."""
        if isinstance(frames, str | int):
            raise TypeError(
                f"frames are {frames!r:.40}; expected a list of positions or names, such as [{frames!r:.40}]"
            )
        if frames is not None and not isinstance(frames, Iterable):
            raise TypeError(f"frames are {type(frames).__name__}; expected a list of positions or names")
        positions = range(len(self)) if frames is None else [self.index(frame) for frame in frames]
        if not positions:
            raise ValueError(f"the list of frames is empty; {self.path} has {len(self)}")
        if len(set(positions)) < len(positions):
            twice = next(one for one in positions if list(positions).count(one) > 1)
            raise ValueError(f"frame {twice} ({self.frames[twice].name}) is there twice; expected each frame once")
        return positions

    def read(
        self,
        frames: Iterable[int | str],
        size: Sequence[int] | Literal["native"] | None = None,
        depth_range: DepthRange | tuple[float, float] | None = None,
        *,
        fit: Fit = "crop",
    ) -> Views:
        """Read frames as undistorted views in the world around `origin`, with labels and depths if all of them have some.

        Args:
            frames: positions or names, in the order you want.
            size: (height, width). None is the size that `semgs reconstruct` uses: `default_size` of the first frame, at most
                76,800 pixels. "native" keeps the full size.
            depth_range: near and far of the views; None for `depth_range` of these frames.
            fit: what is done with images of another aspect than `size`.

        Raises:
            ValueError: no frame has that position or name, the list is empty or has one twice, sizes differ and `size` is "native", or `size` is invalid.
            InputError: an image, depth or label file cannot be used.
        """
        positions = self._positions(frames)
        chosen = [self.frames[index] for index in positions]
        bounds = depth_range or self.depth_range(positions)
        wanted = _wanted(chosen, size)
        near_far = bounds if isinstance(bounds, tuple) else (bounds.near, bounds.far)
        views = [frame.view(near_far, self.classes, size=wanted, fit=fit) for frame in chosen]
        with input_error(self.path, "bounds, colours and depth in range"):
            return self.local(joined(views)).checked()


def _of_elsewhere(name: str) -> str:
    """What to do about a missing file with an absolute path; "" if its path is relative."""
    absolute = name.startswith("/") or PureWindowsPath(name).drive
    return (
        ". If the paths are those of another computer, make them relative to the file that lists them"
        if absolute
        else ""
    )


def _beside(path: Path, name: str) -> str:
    """What to do about a missing file in whose folder are others of its kind; "" if there are none.

    Args:
        path: the file or folder that describes the scene.
        name: of the missing file, as listed.
    """
    folder = (path if path.is_dir() else path.parent) / PurePosixPath(name).parent
    if path.suffix.lower() == ".zip" or not may_read(folder) or not folder.is_dir():
        return ""
    kinds = {PurePosixPath(name).suffix.lower() or ".png", ".png", ".jpg"}
    others = sorted(
        (one.name for one in not_hidden(folder.iterdir()) if one.suffix.lower() in kinds), key=natural_order
    )
    if not others:
        return ""
    return f". Its folder has {counted(len(others), 'other image')}, from {others[0]} to {others[-1]}: correct the names in the file that lists them"


def _wanted(frames: Sequence[Frame], size: Sequence[int] | Literal["native"] | None) -> Sequence[int] | None:
    """The (height, width) to resize frames to, None for their full size; arguments as for `Scene.read`."""
    first = frames[0]
    if size is None:
        return default_size(first.lens.size)
    if not isinstance(size, str):
        return size
    if size != "native":
        raise ValueError(
            f"size is {size!r}; expected (height, width), 'native', or None for a size that suits the networks"
        )
    for frame in frames[1:]:
        if frame.lens.size != first.lens.size:
            raise ValueError(
                f"{first.name} is {first.lens.size} (height, width) and {frame.name} {frame.lens.size}; "
                "give a size for all"
            )
    return None
