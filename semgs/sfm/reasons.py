"""Why the cameras of photos could not be estimated, and what helps; and how well two photos show the motion between their cameras.

A wrong motion may fit a few matches with little parallax as well as the right one.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass
from itertools import combinations
from pathlib import Path
from typing import Any

import cv2
import numpy as np
from jaxtyping import Float64

from semgs.sfm.pycolmap_library import pycolmap

FEW_FEATURES = 60
"""Photos with fewer features show too little detail."""

SAMPLE = 400
"""Descriptors of a photo that are compared with those of another."""

CLOSE, ALIKE = 0.3, 0.9
"""Descriptors nearer than `CLOSE` (of unit length) show the same thing. If the second nearest is nearly as close, it is there more than once."""


COMMON = 0.3
"""At least this share of the features has to appear in both photos."""

MOST_DEG = 3.5
"""The direction of the motion has at most this standard deviation. Right directions of 256 px photos had up to 3; most wrong ones had 5 and more."""

LEAST_NOISE_PX = 0.15
"""Matches are not trusted to be more precise than this [px]."""

TURNED = 0.003
"""If a turn moves all pixels to within this share of the longer side of where they are, the camera only turned."""

STEP = 1e-5
"""Of the differences that derivatives are taken by."""


@dataclass(frozen=True)
class Reason:
    """Why there are no cameras.

    Attributes:
        found: what the photos are like, as a phrase.
        hint: what to do.
    """

    found: str
    hint: str


NO_DETAIL = Reason("too little detail in them", "use sharp, well-lit photos that show furniture, not only walls")
REPEATED = Reason(
    "a texture that repeats, so it is unclear what matches",
    "take photos that also show something that is there only once",
)
NO_OVERLAP = Reason("too little overlap", "take photos that share at least half of what they show with the next one")
TURNING = Reason(
    "a camera that only turned", "step sideways between photos, half a metre or so, and keep the same things in view"
)
FLAT = Reason(
    "a single plane in view, or a camera that only turned", "step sideways, and show things at several depths"
)
UNSTEADY = Reason(
    "matches that do not fit one scene",
    "use photos of a scene at rest, taken with one camera, and add some from between these",
)


def why_not(database: Path, hardly_moved: bool) -> Reason:
    """The likeliest reason.

    Args:
        database: COLMAP's, after matching.
        hardly_moved: whether cameras were estimated, but all in one place.
    """
    library = pycolmap()
    with library.Database.open(database) as held:
        numbers = [image.image_id for image in held.read_all_images()]
        counts = [held.num_keypoints_for_image(number) for number in numbers]
        descriptors = [_unit(held.read_descriptors(number)) for number in numbers]
        _, geometries = held.read_two_view_geometries()
        kinds = Counter(int(one.config) for one in geometries if len(one.inlier_matches))
    if sorted(counts)[-2] < FEW_FEATURES:
        return NO_DETAIL
    kind = library.TwoViewGeometryConfiguration
    turned, flat = (int(getattr(kind, name)) for name in ("PANORAMIC", "PLANAR"))
    either = int(kind.PLANAR_OR_PANORAMIC)
    total = sum(kinds.values())
    if total == 0:
        return REPEATED if repeats(descriptors) else NO_OVERLAP
    if kinds[turned] > total / 2:
        return TURNING
    if kinds[turned] + kinds[flat] + kinds[either] > total / 2:
        return FLAT
    return TURNING if hardly_moved else UNSTEADY


def repeats(descriptors: Sequence[np.ndarray]) -> bool:
    """Whether most features that appear in two photos appear there several times."""
    close = alike = compared = 0
    for first, second in combinations(descriptors, 2):
        if len(first) and len(second) > 1:
            nearest = np.sort(np.sqrt(np.maximum(2 - 2 * first[:: -(-len(first) // SAMPLE)] @ second.T, 0)), axis=1)
            same = nearest[:, 0] < CLOSE
            close, compared = close + same.sum(), compared + len(same)
            alike += (same & (nearest[:, 0] > ALIKE * nearest[:, 1])).sum()
    return bool(close > COMMON * compared and alike > close / 2)


def _unit(descriptors: object) -> np.ndarray:
    """Descriptors [n 128] at unit length."""
    data = np.asarray(getattr(descriptors, "data", descriptors), dtype=np.float64).reshape(-1, 128)
    return data / np.maximum(np.linalg.norm(data, axis=1, keepdims=True), 1e-12)


def matches_of(model: Any) -> Float64[np.ndarray, "2 n 2"]:
    """The points of a pycolmap model of two photos as seen in each, from its principal point, at the first one's focal length [px]. That has the smaller number."""
    first, second = (model.images[number] for number in sorted(model.images))
    pairs = [{one.image_id: one.point2D_idx for one in point.track.elements} for point in model.points3D.values()]
    found = []
    for image in (first, second):
        focal, *middle = model.cameras[image.camera_id].params[:3]
        seen = np.array([image.points2D[pair[image.image_id]].xy for pair in pairs], dtype=np.float64).reshape(-1, 2)
        found.append((seen - middle) * (model.cameras[first.camera_id].params[0] / focal))
    return np.stack(found)


def direction_error_deg(
    matches: Float64[np.ndarray, "2 n 2"], focal_px: float, second_from_first: Float64[np.ndarray, "4 4"]
) -> float:
    """The standard deviation of the direction in which the camera moved, along its least certain axis, from the distances of matches to their epipolar lines [degrees].

    It is infinite if the matches do not determine the direction.

    Args:
        matches: positions in both photos, from the principal point [px].
        focal_px: of both photos.
        second_from_first: coordinates of the first camera to those of the second.
    """
    if matches.shape[1] < 6:
        return float("inf")
    rays = np.concatenate((matches / focal_px, np.ones((*matches.shape[:2], 1))), axis=-1)
    rotation, motion = second_from_first[:3, :3], second_from_first[:3, 3] / np.linalg.norm(second_from_first[:3, 3])
    across = np.linalg.svd(motion[None])[2][1:]

    def distances(change: np.ndarray) -> np.ndarray:
        turned = cv2.Rodrigues(change[:3])[0] @ rotation
        essential = np.cross(motion + change[3:] @ across, turned, axisb=0, axisc=0)
        lines = rays[0] @ essential.T, rays[1] @ essential
        length = np.sqrt(sum((line[:, :2] ** 2).sum(1) for line in lines))
        return np.asarray(focal_px * (lines[0] * rays[1]).sum(1) / length)

    slopes = np.stack([(distances(one) - distances(-one)) / (2 * STEP) for one in STEP * np.eye(5)], axis=1)
    noise = max(1.48 * float(np.median(np.abs(distances(np.zeros(5))))), LEAST_NOISE_PX)
    normal = slopes.T @ slopes
    if np.linalg.cond(normal) > 1 / np.finfo(float).eps:
        return float("inf")
    return float(np.degrees(noise * np.sqrt(np.linalg.eigvalsh(np.linalg.inv(normal)[3:, 3:])[-1])))


def parallax_px(matches: Float64[np.ndarray, "2 n 2"], focal_px: float) -> float:
    """How far the median match is from where the turn of a camera whose focal length is unknown would move it [px]. Only motion leaves more than noise.

    Args:
        matches: positions in both photos, from the principal point [px].
        focal_px: where to start.
    """
    from scipy.optimize import least_squares  # takes a second to import, only for photos without cameras

    def off(values: np.ndarray) -> np.ndarray:
        focal = focal_px * np.exp(values[3])
        turned = np.concatenate((matches[0] / focal, np.ones((matches.shape[1], 1))), axis=1)
        turned = turned @ cv2.Rodrigues(values[:3])[0].T
        return np.asarray(focal * turned[:, :2] / turned[:, 2:] - matches[1])

    starts = [np.array([0.0, 0.0, 0.0, start]) for start in (-0.5, 0.0, 0.5)]
    fits = [least_squares(lambda values: off(values).ravel(), start, loss="soft_l1", max_nfev=50).x for start in starts]
    return min(float(np.median(np.linalg.norm(off(fit), axis=1))) for fit in fits)
