"""What was understood of a scene, as text: layout, frames, focal length, unit, depth, baselines, overlaps."""

from __future__ import annotations

import numpy as np

from semgs.data.choosing.covisibility import Covisibility, DepthGrids
from semgs.data.scene import Scene
from semgs.data.spread import spread
from semgs.doctor.unit import UnitVerdict
from semgs.figures.number_texts import length, percent

MOST_FRAMES = 40
"""Baselines and overlaps are those of this many frames, evenly spread, and their neighbours in the file's order."""


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
