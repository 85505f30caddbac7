"""Near and far: the depth range in which a model looks for surfaces, and where it comes from.

For metric scenes, these are the depths of rooms, unless sparse points, triangulated points or depth maps contradict them. Otherwise they come from
the scene: from its sparse points, from points triangulated between its images, or at least from the distances between its cameras. Depth maps
alone are used only if nothing else is known of a metric scene, because results are compared with them.
"""

from __future__ import annotations

import itertools
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from semgs.data.bounds.parallax import FrameFeatures, find_features, inverse_depths
from semgs.data.frames import Frame
from semgs.data.spread import spread
from semgs.data.views import INDOOR_DEPTH_RANGE
from semgs.files.errors import InputError

ROOM_RATIO = INDOOR_DEPTH_RANGE[1] / INDOOR_DEPTH_RANGE[0]
"""Far / near of rooms. Without metres, the range around the middle depth has at least this ratio."""

MIDDLE_PER_BASELINE = 10.0
"""A good pair of views has a baseline of 5 to 15 % of the middle depth. If nothing better is known, pairs are assumed to be good."""

FEW_POINTS = 20
"""Fewer points than this are not used."""

CONTRADICTS = 0.25
"""If at least this share of the points of a metric scene is outside of the range of rooms, the range comes from the points."""

MOSTLY = 0.5
"""The same if depth maps are within the range of rooms: then fewer points may be wrong matches."""

BOTH_CONTRADICT = 0.05
"""The same if depth maps say so too, or if there are only depth maps: they have no wrong matches."""

SLACK = 1.1
"""Depths beyond the range of rooms by less than this factor are not outside of it."""

LOOKING = 100
"""Sparse points are looked at from so many of the frames, evenly spread: enough for percentiles, in a recording of any length."""

GRID = 24
"""Depth maps are sampled at this many places along each side."""


@dataclass(frozen=True)
class DepthRange:
    """Near and far of a set of views.

    Attributes:
        near: the smallest z-depth [m, or the scene's unit].
        far: the largest.
        unit: "metric" or "unknown".
        reason: where they come from, as a phrase.
        median: of the z-depths that near and far come from; None if they do not come from depths.
    """

    near: float
    far: float
    unit: str
    reason: str
    median: float | None = None

    @property
    def middle(self) -> float:
        """The geometric mean of near and far. Overlap and baselines of training samples are judged at this depth."""
        return (self.near * self.far) ** 0.5

    @property
    def typical(self) -> float:
        """The typical depth: the median if it is known, else the middle."""
        return self.middle if self.median is None else self.median


def depth_range(
    frames: Sequence[Frame],
    positions: Sequence[int],
    unit: str,
    points: np.ndarray | None = None,
    features: dict[int, FrameFeatures] | None = None,
    *,
    stated: bool = False,
) -> DepthRange:
    """Near and far for some frames of a scene.

    Args:
        frames: all usable frames of the scene.
        positions: positions of the frames that the range is for.
        unit: "metric" or "unknown".
        points: the scene's sparse points [n 3] in the world, or None.
        features: known features of frames by their positions; new ones are added.
        stated: take the range of rooms for metric scenes without looking at their images, as protocols do.
    """
    rooms = DepthRange(*INDOOR_DEPTH_RANGE, unit, "the scene is metric, and this is the range of rooms")
    if unit == "metric" and stated:
        return rooms
    try:
        seen = _seen(frames, positions, points, {} if features is None else features)
    except InputError:
        if unit != "metric":
            raise
        seen = None  # a metric scene needs no images for its range; reading the frame will say what is wrong
    if unit != "metric":
        return _from_baseline(frames, positions, unit) if seen is None else _around(seen.inverse, unit, seen.reason)
    share = 0.0 if seen is None else _outside(seen.inverse)
    if seen is None or BOTH_CONTRADICT <= share < MOSTLY:
        measured = _inverse_depths_of_maps([frames[index] for index in dict.fromkeys(spread(positions, 4))])
        if len(measured) >= FEW_POINTS:
            if _outside(measured) < BOTH_CONTRADICT:
                return rooms
            seen = seen or Seen(measured, "from the depth maps")
            share = max(share, _outside(measured))
        elif seen is None or share < CONTRADICTS:
            return rooms
    elif share < CONTRADICTS:
        return rooms
    near, far = INDOOR_DEPTH_RANGE
    return _around(
        seen.inverse,
        unit,
        f"{seen.reason}, as {share:.0%} of them are outside of {near:g} to {far:g} m, the range of rooms",
    )


@dataclass(frozen=True)
class Seen:
    """Depths that a scene shows by itself.

    Attributes:
        inverse: inverse z-depths.
        reason: where they are from, as a phrase.
    """

    inverse: np.ndarray
    reason: str


def _seen(
    frames: Sequence[Frame], positions: Sequence[int], points: np.ndarray | None, pictures: dict[int, FrameFeatures]
) -> Seen | None:
    """Depths of the sparse points that frames see, or else of points triangulated between images; None if there are too few."""
    if points is not None:
        few = spread(positions, LOOKING)
        inverse = 1 / np.concatenate([depths_of_points(frames[index], points) for index in few])
        if len(inverse) >= FEW_POINTS:
            return Seen(inverse, f"from {len(inverse)} sightings of the scene's sparse points")
    for pairs in (_pairs_among(positions), _pairs_beside(frames, positions)):
        inverse = _triangulated(frames, pairs, pictures)
        if len(inverse) >= FEW_POINTS:
            return Seen(inverse, f"from {len(inverse) // 2} points triangulated between the images")
    return None


def _outside(inverse: np.ndarray) -> float:
    """The share of inverse depths [1/m] that are on one side of the range of rooms rather than on the other: wrong matches are on both."""
    near, far = INDOOR_DEPTH_RANGE
    return abs(float((inverse > SLACK / near).mean() - (inverse < 1 / (SLACK * far)).mean()))


def _inverse_depths_of_maps(frames: Sequence[Frame]) -> np.ndarray:
    """Inverse z-depths at some places of the depth maps of frames, empty if there are none, or if one cannot be read: reading the frame will say so."""
    found = [np.zeros(0)]
    for frame in frames:
        try:
            depths = frame.measured()
        except InputError:
            continue
        if depths is not None:
            rows, columns = (np.linspace(0, side - 1, min(side, GRID)).astype(int) for side in depths.shape)
            known = depths[np.ix_(rows, columns)]
            if not (known > 0).any():
                known = depths
            found.append(1 / known[known > 0].astype(np.float64))
    return np.concatenate(found)


def _around(inverse: np.ndarray, unit: str, reason: str) -> DepthRange:
    """The range around measured inverse depths: like a room around the median, extended to the 2nd and 98th percentile."""
    farthest, middle, nearest = np.percentile(inverse, (2, 50, 98))
    near = min(1 / (middle * ROOM_RATIO**0.5), 0.8 / nearest)
    far = max(ROOM_RATIO**0.5 / middle, 1.25 / max(farthest, 0.02 * middle))
    return DepthRange(float(near), float(far), unit, reason, float(1 / middle))


def depths_of_points(frame: Frame, points: np.ndarray) -> np.ndarray:
    """Z-depths of the sparse points that a frame sees (all points in front of it, if the layout does not say which)."""
    ours = points if frame.points is None else points[frame.points]
    pose = frame.world_from_camera
    depths = (ours - pose[:3, 3]) @ pose[:3, 2]
    return depths[depths > 0]


def _pairs_among(positions: Sequence[int]) -> list[list[tuple[int, int]]]:
    """All pairs of the frames, or of four spread evenly over them; each pair is a trial of its own."""
    few = spread(positions, 4)
    return [[pair] for pair in itertools.combinations(dict.fromkeys(few), 2)]


def _pairs_beside(frames: Sequence[Frame], positions: Sequence[int]) -> list[list[tuple[int, int]]]:
    """For some of the frames, other frames of the scene to try in turn until one shows parallax.

    These are the 1st, 3rd, 9th ... nearest of the frames that look the same way to within 30 degrees: in a video a far frame is needed,
    with few photos the nearest one.
    """
    centres = np.stack([frame.world_from_camera[:3, 3] for frame in frames])
    axes = np.stack([frame.world_from_camera[:3, 2] for frame in frames])
    trials = []
    for index in dict.fromkeys(spread(positions, 4)):
        distances = np.linalg.norm(centres - centres[index], axis=1)
        alike = (axes @ axes[index] > np.cos(np.radians(30))) & (np.arange(len(frames)) != index)
        order = [int(other) for other in np.argsort(distances, kind="stable") if alike[other]]
        trials.append([(index, order[3**power - 1]) for power in range(20) if 3**power <= len(order)])
    return trials


def _triangulated(
    frames: Sequence[Frame], trials: list[list[tuple[int, int]]], pictures: dict[int, FrameFeatures]
) -> np.ndarray:
    """Inverse depths from the first pair of each trial that shows parallax; `pictures` stores features between calls."""
    found = []
    for trial in trials:
        for first, second in trial:
            for index in (first, second):
                if index not in pictures:
                    pictures[index] = find_features(frames[index])
            inverse = inverse_depths(pictures[first], pictures[second])
            if len(inverse):
                found.append(inverse)
                break
    return np.concatenate(found) if found else np.zeros(0)


def _from_baseline(frames: Sequence[Frame], positions: Sequence[int], unit: str) -> DepthRange:
    """The range of a room with a middle depth of `MIDDLE_PER_BASELINE` times the distance between the cameras."""
    everyone = np.stack([frame.world_from_camera[:3, 3] for frame in frames])
    for centres, whose in ((everyone[list(positions)], "these cameras"), (everyone, "the scene's cameras")):
        mean = centres.mean(axis=0)
        count = max(2, len(centres))
        # The root mean square distance of all pairs, without a loop over them.
        baseline = float(np.sqrt(2 * ((centres - mean) ** 2).sum() / (count - 1)))
        if baseline > 1e-9 * (1 + float(np.abs(mean).max())):
            middle = MIDDLE_PER_BASELINE * baseline
            reason = f"{MIDDLE_PER_BASELINE:g} times the distance between {whose} ({baseline:.3g}) as the middle depth"
            return DepthRange(middle / ROOM_RATIO**0.5, middle * ROOM_RATIO**0.5, unit, reason)
    return DepthRange(*INDOOR_DEPTH_RANGE, unit, "all cameras are in one place, so the scale is unknown")
