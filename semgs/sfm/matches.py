"""Matches between overlapping images: what cameras are tested against. They are found without cameras."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from itertools import combinations
from typing import final

import cv2
import numpy as np
from jaxtyping import Float64, Int64

from semgs.data.bounds.sift import LONGEST_SIDE, mutual_matches
from semgs.data.frames import Frame
from semgs.data.scene import Scene
from semgs.files.images.pictures import read_grey

ALL_PAIRS = 12
"""Of scenes with at most this many frames, all pairs are matched."""

STARTS, GAPS = 6, (0, 1, 2, 4, 8)
"""Of larger scenes, frames at these distances in the file's order from a few evenly spread frames."""

FEATURES = 1000
CONTRAST = 0.02
"""Half of OpenCV's default: walls have little else."""

FEWEST = 12
"""Fewer matches say nothing about a pair."""

AGREE = 0.6
"""At least this share of a pair's matches has to fit one epipolar geometry, whichever; else they are mostly wrong."""

FIT_PX = 1.5
"""A match fits an epipolar geometry within this distance [px of the reduced image]."""

LEAST_MOTION_PX = 2.0
"""Pairs whose matches move less than this, in the median, do not test anything [px of the reduced image]."""

AROUND = np.array([[0, 0, 0, 1, -1], [0, 1, -1, 0, 0]])
"""A pixel and its neighbours: steps down and to the right."""

EDGE = 1.05
"""Depth that differs by more than this factor from that of a neighbour is at an edge, where it may be that of either side: it is not used."""

MEASURED = 0.3
"""Depth is used if it was measured at this share of the matches."""

MOST_MATCHES = 200
"""Of a pair; more do not say more."""

ZOOMS = 1.03 ** np.arange(-20.0, 10.0)
"""Focal lengths that a depth camera may have, over that of the images: from 0.55 to 1.3. It is about 0.7 for a RealSense and 1.1
for the first Kinect."""


@final
@dataclass(frozen=True, eq=False)
class Matches:
    """Points seen in two frames, of several pairs of frames.

    Attributes:
        pairs: positions (i, j) of the frames of each pair in the scene.
        pair: the pair of each match.
        points: the undistorted pixel positions of each match in both frames: what a pinhole with the given focal length and principal point
            sees [px of the full image].
        depths: measured z-depth of each match in both frames; NaN if unknown [m].
        shrink: reduced size of the images over full size, for the frames of each match.
        frames: positions of the frames whose features were found.
        zoomed: as `depths`, if the depth camera's focal length is one of `ZOOMS` times that of the images; empty if nothing was measured.
    """

    pairs: Int64[np.ndarray, "p 2"]
    pair: Int64[np.ndarray, " m"]
    points: Float64[np.ndarray, "m 2 2"]
    depths: Float64[np.ndarray, "m 2"]
    shrink: Float64[np.ndarray, "m 2"]
    frames: tuple[int, ...] = ()
    zoomed: Float64[np.ndarray, "k 2 z"] = field(default_factory=lambda: np.zeros((0, 2, len(ZOOMS))))

    def __len__(self) -> int:
        """The number of matches."""
        return len(self.pair)

    @property
    def measured(self) -> bool:
        """Whether depth was measured at enough of the matches, in one of their frames at least."""
        return len(self) > 0 and bool(np.isfinite(self.depths).any(1).mean() > MEASURED)

    def without_depth(self) -> Matches:
        """The same matches as if nothing had been measured."""
        return Matches(self.pairs, self.pair, self.points, np.full_like(self.depths, np.nan), self.shrink, self.frames)


@final
@dataclass(frozen=True, eq=False)
class _Features:
    """The features of a frame: undistorted positions [n 2, px], descriptors, measured depths, also at `ZOOMS` [n z], and reduced over full size."""

    points: np.ndarray
    descriptors: np.ndarray
    depths: np.ndarray
    zoomed: np.ndarray
    shrink: float


def find_matches(scene: Scene, frames: Sequence[int] | None = None, features: int = FEATURES) -> Matches:
    """Match the features of overlapping frames, without using any pose.

    Args:
        scene: the scene.
        frames: positions of the frames to match with each other; None for a selection that fits any scene.
        features: the most of a frame.

    Raises:
        InputError: an image or a depth map cannot be read.
    """
    groups = _groups(len(scene)) if frames is None else [tuple(frames)]
    used = sorted({index for group in groups for index in group})
    found = {index: _features(scene.frames[index], features) for index in used}
    pairs, parts = [], []
    for i, j in sorted({tuple(sorted(pair)) for group in groups for pair in combinations(group, 2)}):
        kept = _pair(found[i], found[j])
        if kept is not None:
            pairs.append((i, j))
            parts.append((found[i], found[j], *kept))
    counts = [len(part[2]) for part in parts]
    shapes = {"points": (2,), "depths": (), "zoomed": (len(ZOOMS),)}

    def stacked(of: int, name: str) -> np.ndarray:
        columns = [getattr(part[of], name)[part[2 + of]] for part in parts]
        return np.concatenate(columns) if columns else np.zeros((0, *shapes[name]))

    shrinks = np.array([[part[0].shrink, part[1].shrink] for part in parts]).reshape(-1, 2)
    return Matches(
        np.array(pairs, dtype=np.int64).reshape(-1, 2),
        np.repeat(np.arange(len(pairs)), counts).astype(np.int64),
        np.stack((stacked(0, "points"), stacked(1, "points")), axis=1),
        np.stack((stacked(0, "depths"), stacked(1, "depths")), axis=1),
        np.repeat(shrinks, counts, axis=0),
        tuple(used),
        np.stack((stacked(0, "zoomed"), stacked(1, "zoomed")), axis=1),
    )


def _groups(count: int) -> list[tuple[int, ...]]:
    """Groups of frames, so that the pairs within a group probably overlap in some scene or other."""
    if count <= ALL_PAIRS:
        return [tuple(range(count))]
    starts = np.linspace(0, count - 1 - max(GAPS), STARTS).round().astype(int) if count > max(GAPS) else [0]
    return [tuple(int(start) + gap for gap in GAPS) for start in starts]


def _features(frame: Frame, most: int) -> _Features:
    """The features of a frame at reduced size."""
    grey = read_grey(frame.picture, frame.lens.size, LONGEST_SIDE)
    keypoints, descriptors = cv2.SIFT.create(nfeatures=most, contrastThreshold=CONTRAST).detectAndCompute(grey, None)
    scale = np.array([frame.lens.size[1] / grey.shape[1], frame.lens.size[0] / grey.shape[0]])
    # OpenCV's positions have the first pixel's centre at 0.
    positions = (np.array([point.pt for point in keypoints], dtype=np.float64).reshape(-1, 2) + 0.5) * scale
    directions = frame.lens.directions(positions)
    seen = np.isfinite(directions).all(axis=1)  # a lens may image no ray in the corners
    directions = directions[seen]
    depths = _depths(frame, directions, np.concatenate(([1.0], ZOOMS)))
    return _Features(
        points=directions[:, :2] * frame.lens.focal + frame.lens.centre,
        descriptors=np.zeros((0, 128), np.float32) if descriptors is None else descriptors[seen],
        depths=depths[:, 0],
        zoomed=depths[:, 1:],
        shrink=float(1 / scale.max()),
    )


def _depths(frame: Frame, directions: np.ndarray, zooms: np.ndarray) -> np.ndarray:
    """The measured z-depth along some directions of a frame, if the depth camera had these focal lengths over the images' [n z]; NaN if unknown."""
    depths = frame.measured()
    if depths is None or not len(directions):
        return np.full((len(directions), len(zooms)), np.nan)
    height, width = depths.shape
    middle = frame.lens.intrinsics[:2, 2]
    offsets = (directions @ frame.lens.intrinsics.T)[:, :2] - middle
    places = middle + zooms[:, None] * offsets[:, None]
    column, row = np.moveaxis(np.floor(places).astype(np.int64), -1, 0)
    inside = (row >= 0) & (row < height) & (column >= 0) & (column < width)
    rows, columns = (
        (place[..., None] + AROUND[axis]).clip(0, side - 1)
        for axis, place, side in ((0, row, height), (1, column, width))
    )
    around = depths[rows, columns].astype(np.float64)
    smooth = around.max(-1) <= EDGE * around.min(-1)
    return np.where(inside & (around[..., 0] > 0) & smooth, around[..., 0], np.nan)


def _pair(first: _Features, second: _Features) -> tuple[np.ndarray, np.ndarray] | None:
    """Indices of the features that two frames share; None if these say nothing."""
    i, j = mutual_matches(first.descriptors, second.descriptors)
    if len(i) < FEWEST:
        return None
    a, b = first.points[i] * first.shrink, second.points[j] * second.shrink
    _, fits = cv2.findFundamentalMat(a, b, cv2.FM_RANSAC, FIT_PX, 0.999, 2000)
    if fits is None:
        return None
    good = np.flatnonzero(fits.ravel())
    if len(good) < max(FEWEST, AGREE * len(i)) or np.median(np.linalg.norm((a - b)[good], axis=1)) < LEAST_MOTION_PX:
        return None
    good = good[:: -(-len(good) // MOST_MATCHES)]
    return i[good], j[good]
