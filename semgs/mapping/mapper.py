"""The mapper: takes frames one by one, and keeps the keyframes and Gaussians of the scene so far."""

from __future__ import annotations

from collections import Counter, deque
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import torch
from torch import Tensor

from semgs.data.bounds.depth_range import DepthRange
from semgs.data.choosing.covisibility import flat_grid, grid_of
from semgs.data.views import Views, joined
from semgs.geometry.cameras import Cameras
from semgs.mapping import merging
from semgs.mapping.keyframes import Known, Verdict, judge_frame, near
from semgs.mapping.merging import KeyframePart
from semgs.mapping.voxels import join_in_voxels
from semgs.scene.encoding import Encoding

MOST_KEYFRAMES = 64
"""With a radius, at most this many keyframes are kept; the farthest one goes first."""

RECENT = 20
"""Steps of the camera that a jump is compared with."""

JUMP = 10.0
"""A pose jumps if the camera moved this many times as far as it usually does, and more than half of the typical depth."""

FEWEST_STEPS = 4
"""Before so many steps are known, nothing is a jump."""

REMEMBERED = 100_000
"""Numbers of at most this many usable frames are kept."""

DARKEST, FLATTEST = 0.02, 0.005
"""An image with a lower mean than the first is black, and one with a lower standard deviation than the second is blank."""

Window = Callable[[Sequence[int], Views], Encoding]
"""Encodes a window: takes the numbers of its frames and the views."""


@dataclass(frozen=True)
class Keyframe:
    """A frame that is used.

    Attributes:
        number: of the frame, in the order of time.
        name: of the frame.
        view: the frame as one view.
        known: as new frames are compared with it.
        part: its Gaussians and what others say about them; None until it was part of a window.
        maps: its depth, confidence of depth, and spread of log depth [3 h w]; None until then.
    """

    number: int
    name: str
    view: Views
    known: Known
    part: KeyframePart | None = None
    maps: Tensor | None = None


@dataclass(frozen=True)
class Merged:
    """The scene from all keyframes so far.

    Attributes:
        encoding: the Gaussians, and depth, confidence and spread of the keyframes.
        views: the keyframes that have Gaussians.
        names, numbers: of these frames.
    """

    encoding: Encoding
    views: Views
    names: tuple[str, ...]
    numbers: tuple[int, ...]


class Mapper:
    """Builds a scene from frames in the order of time. It never looks back at frames that it did not keep.

    Args:
        window: encodes a window.
        bounds: near and far of the frames.
        views: of a window, 2 to 4.
        radius: Gaussians farther than this from the latest camera are dropped; None keeps all [m].
        voxel: Gaussians in the same voxel of this size are joined; None joins none [m].

    Attributes:
        ignored: how many frames were left out, by reason.
        frames: how many frames came.
        windows: how many windows were encoded.
        usable: numbers of the latest `REMEMBERED` frames that were not left out.
        voxel: as given.

    Raises:
        ValueError: a number is outside its range.
    """

    def __init__(
        self,
        window: Window,
        bounds: DepthRange,
        *,
        views: int = 2,
        radius: float | None = None,
        voxel: float | None = None,
    ) -> None:
        if not 2 <= views <= 4:
            raise ValueError(f"views is {views}; expected windows of 2 to 4 views")
        for name, length in (("radius", radius), ("voxel", voxel)):
            if length is not None and not length > 0:
                raise ValueError(f"{name} is {length}; expected a positive length, or None")
        self._window, self._bounds = window, bounds
        self._partners, self._radius, self.voxel = views - 1, radius, voxel
        self._keyframes: tuple[Keyframe, ...] = ()
        self._table: Encoding | None = None
        self._last: Cameras | None = None
        self._suspect: Cameras | None = None
        self._steps: deque[float] = deque(maxlen=RECENT)
        self.ignored: Counter[str] = Counter()
        self.frames = self.windows = 0
        self.usable: deque[int] = deque(maxlen=REMEMBERED)

    def add(self, view: Views, name: str = "") -> bool:
        """Take the next frame; whether the scene has changed.

        Args:
            view: the frame as one view, of the same size as the others.
            name: of the frame; its number by default.
        """
        camera = view.cameras[0]
        reason = unusable(view) or ("its pose jumps" if self._jumps(camera) else None)
        if reason is not None:
            self.ignore(reason)
            return False
        number, self.frames = self.frames, self.frames + 1
        self.usable.append(number)
        verdict = judge_frame(camera, [one.known for one in self._keyframes], self._partners, self._bounds.typical)
        if not verdict.use:
            return False
        self._keyframes = (*self._keyframes, Keyframe(number, name or str(number), view, Known(camera, None)))
        changed = self._encode(verdict)
        self._forget(camera)
        return changed

    def ignore(self, reason: str) -> None:
        """Count a frame that cannot be used."""
        self.frames += 1
        self.ignored[reason] += 1

    def merged(self) -> Merged | None:
        """The scene so far; None before the first window."""
        kept = [one for one in self._keyframes if one.part is not None]
        if not kept or self._table is None:
            return None
        parts = [merging.settle(one.part) for one in kept if one.part is not None]
        gaussians, places = merging.join_parts(parts)
        if self.voxel is not None:
            gaussians, places = join_in_voxels(gaussians, places, self.voxel)
        maps = torch.stack([one.maps for one in kept if one.maps is not None])
        views = joined([one.view for one in kept])
        encoding = replace(
            self._table,
            gaussians=gaussians,
            depths=maps[:, 0],
            confidences=maps[:, 1],
            depth_spread=maps[:, 2],
            depth_range=views.depth_range,
            places=places,
        )
        return Merged(encoding, views, tuple(one.name for one in kept), tuple(one.number for one in kept))

    @property
    def alone(self) -> tuple[str, ...]:
        """Names of the keyframes that share too little with any other."""
        return tuple(one.name for one in self._keyframes if one.part is None)

    def _encode(self, verdict: Verdict) -> bool:
        """Encode the window of the latest keyframe, and merge it; False if it has no partner."""
        if not verdict.partners:
            return False
        members = [*sorted(verdict.partners), len(self._keyframes) - 1]
        views = joined([self._keyframes[index].view for index in members])
        encoding = self._window([self._keyframes[index].number for index in members], views)
        self.windows += 1
        numbers = [self._keyframes[index].number for index in members]
        parts = merging.parts_of(merging.unshrunk(encoding, views.cameras), views, numbers)
        maps = torch.stack((encoding.depths, encoding.confidences, encoding.depth_spread), 1)
        self._table = encoding.map(lambda tensor: tensor[:0])
        keyframes = list(self._keyframes)
        for place, index in enumerate(members):
            if keyframes[index].part is None:
                keyframes = self._with_part(keyframes, index, parts[place], maps[place].clone())
        self._keyframes = tuple(keyframes)
        return True

    def _with_part(self, keyframes: list[Keyframe], index: int, part: KeyframePart, maps: Tensor) -> list[Keyframe]:
        """The keyframes with the Gaussians of one of them, after it and its neighbours have judged one another."""
        one = keyframes[index]
        neighbours = {keyframes[place].number for place in near(one.known.camera, [other.known for other in keyframes])}
        judged_part, found = part, []
        for other in keyframes:
            if other.part is None or other.number not in neighbours:
                found.append(other)
                continue
            judged_part = judged_part.judged_by(other.part.sheet)
            found.append(replace(other, part=other.part.judged_by(part.sheet)))
        grid = grid_of(maps[0].numpy(), "") or flat_grid(self._bounds.typical)
        found[index] = replace(one, part=judged_part, maps=maps, known=replace(one.known, grid=grid))
        return found

    def _forget(self, camera: Cameras) -> None:
        """Drop what is outside the radius around the latest camera, and the farthest keyframes if there are too many."""
        if self._radius is None:
            return
        centre, kept = camera.centres, []
        for one in self._keyframes:
            if one.part is not None:
                means = one.part.gaussians.means
                inside = (means - centre.to(means)).norm(dim=-1) <= self._radius
                one = replace(one, part=one.part[inside])
            elif (one.known.camera.centres - centre).norm() > self._radius:
                continue
            if one.part is None or len(one.part):
                kept.append(one)
        if len(kept) > MOST_KEYFRAMES:
            far = [float((one.known.camera.centres - centre).norm()) for one in kept]
            limit = sorted(far)[MOST_KEYFRAMES - 1]
            kept = [one for one, distance in zip(kept, far, strict=True) if distance <= limit]
        self._keyframes = tuple(kept)

    def _jumps(self, camera: Cameras) -> bool:
        """Whether the pose jumps. The next frame is compared with it too: if it is near there, the camera was really moved."""
        last, suspect = self._last, self._suspect
        self._suspect = None
        if last is None:
            self._last = camera
            return False
        step = _distance(camera, last)
        usual = sorted(self._steps)[len(self._steps) // 2] if len(self._steps) >= FEWEST_STEPS else float("inf")
        limit = max(JUMP * usual, self._bounds.typical / 2)
        if step > limit and (suspect is None or _distance(camera, suspect) > limit):
            self._suspect = camera
            return True
        if step <= limit:
            self._steps.append(step)
        self._last = camera
        return False


def unusable(view: Views) -> str | None:
    """Why a frame cannot be used; None if it can."""
    if float(view.images.mean()) < DARKEST:
        return "its image is black"
    if float(view.images.std()) < FLATTEST:
        return "its image is blank"
    return None


def _distance(one: Cameras, other: Cameras) -> float:
    """The distance between two cameras [m]."""
    return float((one.centres - other.centres).norm())
