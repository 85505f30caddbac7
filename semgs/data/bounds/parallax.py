"""Parallax: depths from features that two posed images share."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from semgs.data.bounds.sift import LONGEST_SIDE, mutual_matches, sift
from semgs.data.frames import Frame
from semgs.files.images.pictures import read_grey

EPIPOLAR_TOLERANCE_PX = 1.5
LEAST_MATCHES = 15
LEAST_PARALLAX = np.radians(0.25)
"""Pairs whose features move less than this between the views are not used: it is only a pixel or two."""


@dataclass(frozen=True, eq=False)
class FrameFeatures:
    """The features of one frame.

    Attributes:
        centre: the camera's optical centre in the world [3].
        axis: its optical axis [3].
        directions: unit directions of the features in the world [n 3].
        descriptors: SIFT [n 128].
        pixel: the angle of one pixel of the reduced image [rad].
    """

    centre: np.ndarray
    axis: np.ndarray
    directions: np.ndarray
    descriptors: np.ndarray
    pixel: float


def find_features(frame: Frame) -> FrameFeatures:
    """The features of a frame at reduced size, as directions in the world.

    Raises:
        InputError: its image cannot be read.
    """
    grey = read_grey(frame.picture, frame.lens.size, LONGEST_SIDE)
    positions, descriptors = sift(grey)
    scale = np.array([frame.lens.size[1] / grey.shape[1], frame.lens.size[0] / grey.shape[0]])
    directions = frame.lens.directions(positions * scale)
    seen = np.isfinite(directions).all(axis=1)  # a lens may image no ray in the corners
    directions = directions[seen] @ frame.world_from_camera[:3, :3].T
    return FrameFeatures(
        centre=frame.world_from_camera[:3, 3],
        axis=frame.world_from_camera[:3, 2],
        directions=directions / np.linalg.norm(directions, axis=1, keepdims=True),
        descriptors=descriptors[seen],
        pixel=float(scale.max() / min(frame.lens.focal)),
    )


def inverse_depths(first: FrameFeatures, second: FrameFeatures) -> np.ndarray:
    """Inverse z-depths, in both frames, of the features that they share; empty if there is too little parallax.

    A match counts if it is mutual, passes Lowe's ratio test, and its two rays meet within `EPIPOLAR_TOLERANCE_PX`. Points too far away to
    show parallax get a value near 0, or 0 if their rays diverge.
    """
    baseline = second.centre - first.centre
    if not np.linalg.norm(baseline) > 0:
        return np.zeros(0)
    i, j = mutual_matches(first.descriptors, second.descriptors)
    a, b = first.directions[i], second.directions[j]
    along = baseline / np.linalg.norm(baseline)
    # With correct poses, a, b and the baseline lie in one plane; the angle out of it is the epipolar error.
    normal = np.cross(along, a)
    normal /= np.maximum(np.linalg.norm(normal, axis=1, keepdims=True), 1e-12)
    meet = np.abs((normal * b).sum(1)) < np.sin(EPIPOLAR_TOLERANCE_PX * max(first.pixel, second.pixel))
    a, b = a[meet], b[meet]
    cosine = (a * b).sum(1)
    sine_squared = np.maximum(1 - cosine**2, 1e-18)
    if len(a) < LEAST_MATCHES or np.median(np.sqrt(sine_squared)) < LEAST_PARALLAX:
        return np.zeros(0)
    # Closest points of the rays first.centre + s a and second.centre + t b.
    s = ((a - cosine[:, None] * b) @ baseline) / sine_squared
    t = ((cosine[:, None] * a - b) @ baseline) / sine_squared
    depths = np.concatenate((s * (a @ first.axis), t * (b @ second.axis)))
    inverse = np.where(depths > 0, 1 / np.where(depths > 0, depths, 1), 0)
    return inverse if np.median(inverse) > 0 else np.zeros(0)
