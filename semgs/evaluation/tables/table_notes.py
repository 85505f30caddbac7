"""Notes that the reader of an evaluation must not miss, a sentence each."""

from __future__ import annotations

import math
from collections.abc import Sequence

from semgs.data.scene import Scene
from semgs.evaluation.frames.frame_plan import FramePlan
from semgs.evaluation.scoring.intervals import FEWEST_SCENES, choose_units
from semgs.evaluation.scoring.method_scores import MethodScores
from semgs.evaluation.scoring.summary import summarise
from semgs.evaluation.tables.evaluation_report import worse_than_copy
from semgs.files.text import counted, listed
from semgs.objectives.measures import TITLES

STRETCH_TOLERANCE = 0.01
"""Images whose aspect ratio changes by more than this are reported."""


def notes(plan: FramePlan, scenes: Sequence[Scene], rows: Sequence[MethodScores], workers: int) -> list[str]:
    """Limitations of an evaluation's numbers.

    Args:
        plan: the targets.
        scenes: all scenes that were found, in the plan or not.
        rows: the scores.
        workers: number of parallel processes.
    """
    return [
        *_left_out(plan, scenes),
        *_without_truth(plan),
        *_without_prediction(rows),
        *_stretched(plan),
        *_below_copy(rows),
        *_intervals(rows),
        *_equal_pictures(rows),
        *_hidden(rows),
        *(
            [f"{workers} processes ran in parallel, so times are longer than for one process alone."]
            if workers > 1 and any(frame.seconds_render is not None for one in rows for frame in one.method)
            else []
        ),
        *(f"{scene.name}: {sentence}" for scene in plan.scenes for sentence in scene.notes),
    ]


def _left_out(plan: FramePlan, scenes: Sequence[Scene]) -> list[str]:
    """Scenes that are not in the plan."""
    unused = [scene.name for scene in scenes if scene not in plan.scenes]
    why = "one of their 30 frames has no pose" if plan.protocol == "lsm" else "the list of frames does not contain them"
    return [f"Left out, because {why}: {listed(unused)}."] if unused else []


def _without_truth(plan: FramePlan) -> list[str]:
    """Scenes without labels or depth."""
    found = []
    for attribute, what, left in (
        ("labels", "labels", "only metrics of colour and depth use these scenes"),
        ("depth", "depth", "metrics of depth and the warped baseline leave these scenes out"),
    ):
        bare = [scene.name for scene in plan.scenes if not any(getattr(frame, attribute) for frame in scene.frames)]
        if bare:
            found.append(f"No {what} in {listed(bare)}: {left}.")
    return found


def _without_prediction(rows: Sequence[MethodScores]) -> list[str]:
    """Kinds of truth for which the method predicts nothing."""
    found = []
    frames = [frame for one in rows for frame in one.method]
    if any(frame.truth is not None and frame.confusion is None for frame in frames):
        found.append("The method predicts no classes, so there are no class metrics.")
    if all(frame.psnr is None for frame in frames):
        found.append("The method predicts no images, so there are no colour metrics.")
    if all(frame.depth is None for frame in frames) and any(one.baselines.get("warp") for one in rows):
        found.append("The method predicts no depth, so there are no depth metrics.")
    return found


def _stretched(plan: FramePlan) -> list[str]:
    """Scenes whose images change their aspect ratio."""
    found = []
    for scene in plan.scenes:
        task = next(task for task in plan.tasks if task.scene is scene)
        height, width = task.size
        rows, columns = scene.frames[0].lens.size
        if abs(height * columns / (width * rows) - 1) > STRETCH_TOLERANCE:
            found.append(
                f"The images of {scene.name} and their cameras are {task.fit}{'ed' if task.fit == 'stretch' else 'ped'} from {rows}x{columns} to {height}x{width} "
                "(height x width)."
            )
    return found


def _below_copy(rows: Sequence[MethodScores]) -> list[str]:
    """Metrics that are worse than those of the oracle that copies the nearest input view."""
    found = []
    for one in rows:
        worse = worse_than_copy(summarise(one.method), summarise(one.baselines["copy"]))
        if worse:
            names = ", ".join(TITLES[name] for name in worse)
            found.append(f"From {one.views} views, worse than the oracle that copies the nearest input view: {names}.")
    return found


def _intervals(rows: Sequence[MethodScores]) -> list[str]:
    """That intervals over frames are too narrow."""
    if not any(choose_units(one.method) == "frames" for one in rows):
        return []
    return [
        f"There are fewer than {FEWEST_SCENES} scenes, so intervals are over frames. "
        "Frames of one scene are similar, so other scenes may differ by more."
    ]


def _equal_pictures(rows: Sequence[MethodScores]) -> list[str]:
    """That some PSNR is infinite."""
    count = sum(frame.psnr is not None and math.isinf(frame.psnr) for one in rows for frame in one.method)
    return (
        [
            f"{counted(count, 'image equals', 'images equal')} the truth, so the PSNR is infinite, and so is any mean that includes it."
        ]
        if count
        else []
    )


def _hidden(rows: Sequence[MethodScores]) -> list[str]:
    """That some pixels of the targets count in no score."""
    targets = {(frame.scene, frame.target): frame.hidden for one in rows for frame in one.method if frame.hidden}
    if not targets:
        return []
    return [
        f"{sum(targets.values()):,} pixels of {len(targets)} targets are a black border or masked, and count in no score."
    ]
