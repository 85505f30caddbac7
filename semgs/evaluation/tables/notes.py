"""What the reader of an evaluation must not miss, a sentence each."""

from __future__ import annotations

import math
from collections.abc import Sequence

from semgs.data.scene import Scene
from semgs.evaluation.frames.plan import Plan
from semgs.evaluation.scoring.evaluate import Rows
from semgs.evaluation.scoring.intervals import FEWEST_SCENES, units
from semgs.evaluation.scoring.summary import summary
from semgs.evaluation.tables.report import below
from semgs.evaluation.tables.texts import TITLES
from semgs.files.text import listed

STRETCH_TOLERANCE = 0.01
"""Pictures whose aspect changes by more than this are told of."""


def notes(plan: Plan, scenes: Sequence[Scene], rows: Sequence[Rows], workers: int) -> list[str]:
    """What limits the numbers of an evaluation.

    Args:
        plan: what was compared.
        scenes: that were found, in the plan or not.
        rows: the scores.
        workers: processes that worked side by side.
    """
    return [
        *_left_out(plan, scenes),
        *_without_truth(plan),
        *_without_prediction(plan, rows),
        *_stretched(plan),
        *_below_copy(rows),
        *_intervals(rows),
        *_equal_pictures(rows),
        *(
            [f"{workers} processes worked side by side, so times are longer than alone."]
            if workers > 1 and any(frame.seconds_render is not None for one in rows for frame in one.method)
            else []
        ),
        *(f"{scene.name}: {sentence}" for scene in plan.scenes for sentence in scene.notes),
    ]


def _left_out(plan: Plan, scenes: Sequence[Scene]) -> list[str]:
    """Scenes that the plan does not name."""
    unused = [scene.name for scene in scenes if scene not in plan.scenes]
    return [f"Not in the list of frames, and left out: {listed(unused)}."] if unused else []


def _without_truth(plan: Plan) -> list[str]:
    """Scenes without labels or depth."""
    found = []
    for attribute, what, left in (
        ("labels", "labels", "they count in metrics of colour and depth only"),
        ("depth", "depth", "they count in no metric of depth, and the row of warped contexts is without them"),
    ):
        bare = [scene.name for scene in plan.scenes if not any(getattr(frame, attribute) for frame in scene.frames)]
        if bare:
            found.append(f"No {what} in {listed(bare)}: {left}.")
    return found


def _without_prediction(plan: Plan, rows: Sequence[Rows]) -> list[str]:
    """Kinds of truth that nothing was predicted for."""
    found = []
    frames = [frame for one in rows for frame in one.method]
    if any(frame.truth is not None and frame.confusion is None for frame in frames):
        found.append("Classes are not predicted: there are no metrics of classes.")
    if all(frame.psnr is None for frame in frames):
        found.append("Pictures are not predicted: there are no metrics of colour.")
    if all(frame.depth is None for frame in frames) and any(one.trivial.get("warp") for one in rows):
        found.append("Depth is not predicted: there are no metrics of depth.")
    return found


def _stretched(plan: Plan) -> list[str]:
    """Scenes whose pictures change their aspect."""
    found = []
    for scene in plan.scenes:
        height, width = next(task.size for task in plan.tasks if task.scene is scene)
        rows, columns = scene.frames[0].lens.size
        if abs(height * columns / (width * rows) - 1) > STRETCH_TOLERANCE:
            found.append(
                f"Pictures of {scene.name} are stretched from {rows}x{columns} to {height}x{width} (height x width); "
                "their cameras are stretched along."
            )
    return found


def _below_copy(rows: Sequence[Rows]) -> list[str]:
    """Metrics that are worse than those of the oracle that copies the nearest input view."""
    found = []
    for one in rows:
        worse = below(summary(one.method), summary(one.trivial["copy"]))
        if worse:
            names = ", ".join(TITLES[name] for name in worse)
            found.append(f"From {one.views} views, worse than the oracle that copies the nearest input view: {names}.")
    return found


def _intervals(rows: Sequence[Rows]) -> list[str]:
    """That few scenes make intervals too narrow."""
    if not any(units(one.method) == "frames" for one in rows):
        return []
    return [
        f"There are fewer than {FEWEST_SCENES} scenes, so intervals are over frames; "
        "frames of one scene are alike, and other scenes may differ by more."
    ]


def _equal_pictures(rows: Sequence[Rows]) -> list[str]:
    """That some PSNR is infinite."""
    count = sum(frame.psnr is not None and math.isinf(frame.psnr) for one in rows for frame in one.method)
    return [f"{count} pictures equal the truth: their PSNR is infinite, and so is any mean over them."] if count else []
