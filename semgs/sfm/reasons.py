"""Why the cameras of photos could not be estimated, and what helps."""

from __future__ import annotations

from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass
from itertools import combinations
from pathlib import Path

import numpy as np

from semgs.sfm.pycolmap_library import pycolmap

FEW_FEATURES = 60
"""Photos with fewer features show too little detail."""

SAMPLE = 400
"""Descriptors of a photo that are compared with those of another."""

CLOSE, ALIKE = 0.3, 0.9
"""Descriptors nearer than `CLOSE` (of unit length) show the same thing. If the second nearest is nearly as close, it is there more than once."""


COMMON = 0.3
"""At least this share of the features has to appear in both photos."""


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
