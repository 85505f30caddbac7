"""What is known about the unit of a scene's lengths: who says it, and what contradicts it."""

from __future__ import annotations

from dataclasses import dataclass
from typing import final

import numpy as np

from semgs.data.bounds.depth_range import depths_of_points
from semgs.data.scene import Scene
from semgs.data.spread import spread
from semgs.doctor.diagnosis import Diagnosis
from semgs.doctor.mistakes import PLAUSIBLE_DEPTH, plausible
from semgs.figures.number_texts import length

SAME = 1.5
"""Depth maps and parallax are in the same unit if they differ by less than this factor in the median."""

ALIKE = 2.5
"""Sparse points and parallax are if their medians differ by less than this factor: the points are others than the matched ones."""

FRAMES = 8
"""Sparse points are looked at from so many frames."""

FEWEST = 20
"""Fewer sparse points say nothing."""


@final
@dataclass(frozen=True)
class UnitVerdict:
    """What is known about the unit of a scene.

    Attributes:
        said: the unit, and who says it.
        seen: what depth maps, sparse points and parallax say about it; "" if nothing can be said.
        doubtful: whether they speak against it.
    """

    said: str
    seen: str = ""
    doubtful: bool = False

    @property
    def text(self) -> str:
        """All of it as a phrase."""
        return f"{self.said}; {self.seen}" if self.seen else self.said


def judge_unit(scene: Scene, found: Diagnosis) -> UnitVerdict:
    """The unit of a scene, why, and what its depth maps, sparse points and parallax say about it.

    Args:
        scene: the scene.
        found: what its images and depth maps say about its cameras.
    """
    metric = scene.unit == "metric"
    if not metric:
        said = "unknown: lengths are in the scene's own unit"
    else:
        said = f"metres: {scene.unit_source or f'all scenes of the layout {scene.layout} are'}"
    seen, measured, points = found.distance, found.evidence.depth if found.evidence else np.nan, _points(scene)
    for what, ratio, factor in (("depth maps", found.depth_ratio, SAME), ("sparse points", points / seen, ALIKE)):
        if abs(np.log(ratio)) > np.log(factor):  # False with NaN
            return UnitVerdict(
                said,
                f"contradicted: {what} are {ratio:.3g} times as far away as parallax puts what the images show, {length(seen, metric)} in the median",
                doubtful=True,
            )
    known = next((one for one in (seen, points, measured) if np.isfinite(one)), np.nan)
    if not metric or np.isnan(known):
        return UnitVerdict(said)
    if plausible(known):
        return UnitVerdict(said, f"what is seen is {length(known, metric)} away, as in a room")
    near, far = PLAUSIBLE_DEPTH
    seen_at = f"what is seen is {length(known, metric)} away in the median, in rooms it is {near:g} to {far:g} m"
    return UnitVerdict(said, f"in doubt: {seen_at}", doubtful=True)


def _points(scene: Scene) -> float:
    """The median z-depth of the sparse points that some frames see; NaN if there are too few."""
    if scene.points is None:
        return np.nan
    every = np.concatenate([depths_of_points(frame, scene.points) for frame in spread(scene.frames, FRAMES)])
    return float(np.median(every)) if len(every) >= FEWEST else np.nan
