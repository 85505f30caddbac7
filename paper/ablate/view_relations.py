"""How the input views of a target lie to one another: what they see in common, and from how different directions."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from semgs.data.choosing.covisibility import Covisibility, DepthGrids
from semgs.data.scene import Scene
from semgs.evaluation.frames.frame_plan import FramePlan


@dataclass(frozen=True)
class ViewRelation:
    """The pair of a target's input views with the least in common.

    Attributes:
        overlap: the share of what one sees that the other sees too, 0 to 1; the smallest of all pairs.
        angle: between the directions in which they look; the largest of all pairs [degrees].
    """

    overlap: float
    angle: float


def view_relations(plan: FramePlan, views: int) -> list[ViewRelation]:
    """The relation of the input views of each target with that many, in the plan's order.

    Overlap is measured with the depth maps or sparse points of the scene, or, if it has neither, at one assumed depth.
    """
    tasks = plan.of(views)
    found: dict[str, tuple[np.ndarray, np.ndarray]] = {
        scene.name: _tables(scene) for scene in {task.scene.name: task.scene for task in tasks}.values()
    }
    return [_relation(*found[task.scene.name], task.sample.contexts) for task in tasks]


def thirds(values: Sequence[float]) -> list[list[int]]:
    """The positions of the smallest third of the values, the middle third and the largest; ties stay in order."""
    order = np.argsort(np.asarray(values), kind="stable")
    return [sorted(part.tolist()) for part in np.array_split(order, 3)]


def _tables(scene: Scene) -> tuple[np.ndarray, np.ndarray]:
    """Overlaps [n n] and angles [n n] of a scene's frames."""
    indices = np.arange(len(scene))
    grids = DepthGrids(scene).of(indices, scene.depth_range().typical)
    ahead = np.stack([frame.world_from_camera[:3, 2] for frame in scene.frames])
    cosines = (ahead @ ahead.T).clip(-1, 1)
    return Covisibility.of(scene, indices, grids).overlaps(), np.degrees(np.arccos(cosines))


def _relation(overlaps: np.ndarray, angles: np.ndarray, contexts: Sequence[int]) -> ViewRelation:
    first, second = np.triu_indices(len(contexts), 1)
    chosen = np.asarray(contexts)
    pairs = chosen[first], chosen[second]
    return ViewRelation(float(overlaps[pairs].min()), float(angles[pairs].max()))
