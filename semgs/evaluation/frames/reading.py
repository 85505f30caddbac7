"""Reads the frames of a task, and prepares what a method gets."""

from __future__ import annotations

from collections.abc import Mapping

from semgs.data.bounds.depth_range import DepthRange
from semgs.data.views import Views, joined
from semgs.evaluation.frames.frame_plan import Task
from semgs.evaluation.frames.predictions import Inputs


def read_frame(task: Task, position: int, bounds: DepthRange | tuple[float, float]) -> Views:
    """Read a frame of the task's scene as one view at the size of the evaluation.

    Raises:
        InputError: one of its files cannot be used.
    """
    return task.scene.read([position], task.size, bounds, fit=task.fit)


def read_views(task: Task, depth_range: tuple[float, float] | None = None) -> dict[int, Views]:
    """Read the contexts and the target of a task. Returns one view each, by position in the scene.

    Args:
        task: the target.
        depth_range: near and far of the views; None uses the bounds of the scene.

    Raises:
        InputError: one of their files cannot be used.
    """
    bounds = depth_range or task.scene.depth_range(task.sample.contexts, stated=True)
    return {position: read_frame(task, position, bounds) for position in task.sample.frames}


def make_inputs(task: Task, views: Mapping[int, Views]) -> Inputs:
    """What a method gets from `read_views`: no labels and no depths."""
    measured = joined([views[index] for index in task.sample.contexts]).changed(labels=None)
    contexts = measured.changed(depths=None)
    return Inputs(task, contexts, views[task.sample.target].cameras, None if measured.depths is None else measured)
