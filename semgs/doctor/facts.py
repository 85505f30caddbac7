"""What was understood of a scene, as text: layout, frames, focal length, unit, depth, baselines, overlaps; and who says the unit of its lengths, and what contradicts it."""

from __future__ import annotations

from dataclasses import dataclass
from typing import final

import numpy as np

from semgs.data.bounds.depth_range import depths_of_points
from semgs.data.choosing.covisibility import Covisibility, DepthGrids
from semgs.data.scene import Scene
from semgs.data.spread import spread
from semgs.doctor.diagnosis import Diagnosis
from semgs.doctor.mistakes import PLAUSIBLE_DEPTH, plausible
from semgs.files.text import length, percent

MOST_FRAMES = 40
"""Baselines and overlaps are those of this many frames, evenly spread, and their neighbours in the file's order."""

SAME = 1.5
"""Depth maps and parallax are in the same unit if they differ by less than this factor in the median."""

ALIKE = 2.5
"""Sparse points and parallax are if their medians differ by less than this factor: the points are others than the matched ones."""

FRAMES = 8
"""Sparse points are looked at from so many frames."""

FEWEST = 20
"""Fewer sparse points say nothing."""


def facts(scene: Scene, unit: UnitVerdict) -> tuple[tuple[str, str], ...]:
    """Pairs of name and text.

    Args:
        scene: the scene.
        unit: what is known about the unit of its lengths.

    Raises:
        InputError: the scale has to be found from images, and one cannot be read.
    """
    metric = scene.unit == "metric"
    lenses = [frame.lens for frame in scene.frames]
    sizes = sorted({lens.size for lens in lenses})
    focal = np.array([lens.focal for lens in lenses])
    angles = np.degrees(2 * np.arctan(np.array([lens.size[::-1] for lens in lenses]) / (2 * focal)))
    bounds = scene.depth_range()
    few = _few(scene)
    grids = DepthGrids(scene)
    together = Covisibility.of(scene, few, grids.of(few, bounds.typical))
    steps = np.diagonal(together.baselines, 1)
    overlaps = np.diagonal(together.overlaps(), 1)
    measured = sum(frame.depth is not None for frame in scene.frames)
    return (
        ("layout", scene.layout),
        ("frames", f"{len(scene)}" + (f", and {len(scene.absent)} listed without image" if scene.absent else "")),
        ("image size", ", ".join(f"{height}x{width}" for height, width in sizes[:3]) + " (height x width)"),
        ("focal length", f"{_range(focal[:, 0])} px across, {_range(focal[:, 1])} px down"),
        ("angle of view", f"{_range(angles[:, 0])} degrees across, {_range(angles[:, 1])} degrees down"),
        ("lens distortion", "none" if all(lens.is_pinhole for lens in lenses) else "undone on reading"),
        ("unit", unit.text),
        ("measured depth", f"{measured} of {len(scene)} frames" + ("" if not measured else _depths(grids, few, metric))),
        ("depth range", f"{length(bounds.near, metric)} to {length(bounds.far, metric)}: {bounds.reason}"),
        ("distance of neighbours", f"{length(float(np.median(steps)), metric)}, at most {length(float(steps.max()), metric)}"),
        ("overlap of neighbours", f"{percent(float(np.median(overlaps)))}, at least {percent(float(overlaps.min()))}, under these cameras"),
    )  # fmt: skip


def coverage(scene: Scene) -> list[tuple[str, float]]:
    """Names of some frames, and the share of what each sees that another of them also sees.

    Raises:
        InputError: as `facts`.
    """
    few = _few(scene)
    together = Covisibility.of(scene, few, DepthGrids(scene).of(few, scene.depth_range().typical))
    others = [np.delete(np.arange(len(few)), index).tolist() for index in range(len(few))]
    return [
        (scene.frames[place].name, float(together.covered(others[index])[index]))
        for index, place in enumerate(few.tolist())
    ]


def _few(scene: Scene) -> np.ndarray:
    """Positions of at most `MOST_FRAMES` frames, evenly spread."""
    return np.array(spread(range(len(scene)), MOST_FRAMES))


def _range(numbers: np.ndarray) -> str:
    """The smallest and largest of some numbers, once if they look the same."""
    low, high = f"{numbers.min():.1f}", f"{numbers.max():.1f}"
    return low if low == high else f"{low} to {high}"


def _depths(grids: DepthGrids, few: np.ndarray, metric: bool) -> str:
    """The median of the measured depths."""
    found = [grid.median for grid in grids.of(few, np.nan) if grid.source == "measured depth"]
    return f", {length(float(np.median(found)), metric)} in the median" if found else ""


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
