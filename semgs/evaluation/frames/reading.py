"""Reading the frames of a task, and what of them a method is given."""

from __future__ import annotations

from collections.abc import Mapping

from semgs.data.views import Views, joined
from semgs.evaluation.frames.plan import Task
from semgs.evaluation.frames.predictions import Inputs


def read_frame(task: Task, position: int, bounds: tuple[float, float]) -> Views:
    """A frame of the task's scene as one view at the size of the evaluation.

    Raises:
        InputError: a file of it cannot be used.
    """
    return task.scene.local(task.scene.frames[position].read(bounds, task.scene.classes, size=task.size))


def read_views(task: Task, depth_range: tuple[float, float] | None = None) -> dict[int, Views]:
    """The contexts and the target of a task by their positions in the scene, one view each.

    Args:
        task: what is compared.
        depth_range: near and far to give them; None is what the scene knows.

    Raises:
        InputError: a file of them cannot be used.
    """
    if depth_range is None:
        found = task.scene.depth_range(task.sample.contexts)
        depth_range = (found.near, found.far)
    return {
        position: read_frame(task, position, depth_range) for position in (*task.sample.contexts, task.sample.target)
    }


def inputs_of(task: Task, views: Mapping[int, Views]) -> Inputs:
    """What a method is given of `read_views`: neither labels nor depths."""
    contexts = joined([views[index] for index in task.sample.contexts]).changed(labels=None, depths=None)
    return Inputs(task, contexts, views[task.sample.target].cameras)
