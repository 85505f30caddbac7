"""Scores a method and the simple baselines on every target of a plan."""

from __future__ import annotations

import hashlib
from collections.abc import Callable, Mapping, Sequence
from contextlib import closing
from dataclasses import dataclass, field, replace
from pathlib import Path

import numpy as np

from semgs.data.tables.class_groups import ClassGroups
from semgs.data.tables.classes import IGNORE
from semgs.data.views import INDOOR_DEPTH_RANGE, Views
from semgs.evaluation.frames.frame_plan import FramePlan, Task
from semgs.evaluation.frames.predictions import Method, Prediction, write_maps, write_prediction
from semgs.evaluation.frames.protocols import nearest_first
from semgs.evaluation.frames.reading import make_inputs, read_frame, read_views
from semgs.evaluation.scoring.baselines import copy_nearest, predict_majority, warp_contexts
from semgs.evaluation.scoring.frame_scores import (
    FrameScores,
    PerceptualDistance,
    aside_scores,
    changes,
    perceptual_distance,
    score,
)
from semgs.evaluation.scoring.panoptic import Rule, count_boxes, count_segments, true_boxes
from semgs.evaluation.scoring.summary import find_extremes
from semgs.files.errors import check_type
from semgs.runtime.workers import outcomes

PREDICTIONS = "predictions"
"""Folder of the method's predictions, in the format of `--predictions`."""
TRUTH = "truth"
"""Folder of the true labels at the size of the evaluation."""
SHOWN = 10
"""The report shows this many of the best and of the worst targets, for each number of views."""


@dataclass(frozen=True, eq=False)
class MethodScores:
    """The scores of all targets for one number of views, in the order of the plan.

    Attributes:
        views: the number of contexts.
        method: the scores of the method.
        baselines: the scores of the baselines, by their names in `semgs.evaluation.scoring.baselines.NAMES`. A baseline that
            needs truth that some scenes lack has fewer targets, or is absent.
        truth: a hash of the true labels and depths. Images are left out, because their resizing may differ in the last bit
            between machines.
        shown: the predictions for the `SHOWN` best and worst targets, by scene and target.
    """

    views: int
    method: tuple[FrameScores, ...]
    baselines: dict[str, tuple[FrameScores, ...]]
    truth: str
    shown: dict[tuple[str, str], Prediction] = field(default_factory=dict)

    def by_groups(self, groups: ClassGroups) -> MethodScores:
        """The same, with counts by groups of classes."""
        baselines = {name: tuple(one.by_groups(groups) for one in frames) for name, frames in self.baselines.items()}
        return replace(self, method=tuple(one.by_groups(groups) for one in self.method), baselines=baselines)


def score_method(
    plan: FramePlan,
    method: Method,
    folder: Path,
    *,
    save: bool = True,
    workers: int = 0,
    done: Callable[[int], object] = lambda count: None,
    panoptic: Rule | None = None,
) -> list[MethodScores]:
    """Score a method and the baselines on every target of a plan.

    Args:
        plan: the targets.
        method: the method.
        folder: an existing folder; gets true labels in `truth/` and, with `save`, predictions in `predictions/`.
        save: write the predictions.
        workers: parallel processes, each with one thread; 0 uses this process and its threads.
        done: called after each target with the number of finished targets.
        panoptic: the rule of panoptic quality; None for none.

    Raises:
        InputError: a frame or prediction cannot be used.
        NotEnoughMemoryError: the network needs more memory than there is.
        OSError: the disk is full.
    """
    check_type("the plan is", plan, FramePlan, "FramePlan, as semgs.evaluation.frames.frame_plan makes it")
    scorer = _TargetScorer(method, plan.depth_range, folder, save, perceptual_distance(), panoptic)
    scores: dict[int, list[_TargetScores]] = {views: [] for views in plan.views}
    shown: dict[int, list[tuple[FrameScores, Prediction]]] = {views: [] for views in plan.views}
    with closing(outcomes(scorer, plan.tasks, workers)) as results:
        for count, result in enumerate(results, 1):
            if isinstance(result, Exception):
                raise result
            target, prediction = result
            views = len(target.method.contexts)
            scores[views].append(target)
            # A copy, because tensors from another process keep a file of shared memory open.
            shown[views] = _keep_extremes([*shown[views], (target.method, prediction.copy())])
            done(count)
    return [_combine(views, scores[views], shown[views]) for views in plan.views]


@dataclass(frozen=True, eq=False)
class _TargetScores:
    """One target: the method's scores, those before it refines, of copy and of warp, and a hash of the truth."""

    method: FrameScores
    one_pass: FrameScores | None
    copy: FrameScores
    warp: FrameScores | None
    truth: str


@dataclass(frozen=True, eq=False)
class _TargetScorer:
    """Scores a target: reads its frames, predicts, writes the maps and compares them."""

    method: Method
    depth_range: tuple[float, float] | None
    folder: Path
    save: bool
    perceptual: PerceptualDistance | None
    panoptic: Rule | None

    def __call__(self, task: Task) -> tuple[_TargetScores, Prediction]:
        """The scores of a target, and the prediction."""
        views = read_views(task, self.depth_range)
        target = views[task.sample.target]
        prediction = self.method.predict(make_inputs(task, views))
        if self.save:
            write_prediction(self.folder / PREDICTIONS, task, prediction)
        if target.labels is not None:
            write_maps(self.folder / TRUTH, task.truth_stem, Prediction(labels=target.labels[0]), metric=True)
        ordered = [views[position] for position in nearest_first(task.scene, task.sample)]
        warped = warp_contexts(ordered, target)

        def scored(given: Prediction) -> FrameScores:
            """The scores of a prediction."""
            scores = score(task, given, target, self.perceptual)
            if not task.kind:
                return scores
            unseen = None if warped is None else warped.unseen
            return replace(scores, more=aside_scores(given, target, unseen))

        own = self._with_things(scored(prediction), task, prediction, views)
        if task.sample.others:
            again = self.method.predict(make_inputs(task.from_others(), views))
            own = replace(own, more={**own.more, **changes(prediction, again)})
        scores = _TargetScores(
            method=own,
            one_pass=None if prediction.one_pass is None else scored(prediction.one_pass),
            copy=scored(copy_nearest(ordered[0])),
            warp=None if warped is None else scored(warped),
            truth=_hash_truth(target),
        )
        return scores, prediction

    def _with_things(
        self, scores: FrameScores, task: Task, prediction: Prediction, views: Mapping[int, Views]
    ) -> FrameScores:
        """Scores with those of things, if they are requested and the target's true things are known."""
        target, frames = views[task.sample.target], task.scene.frames
        numbers = frames[task.sample.target].things(target, task.fit)
        if self.panoptic is None or numbers is None or target.labels is None or prediction.labels is None:
            return scores
        given = np.zeros(task.size, np.int32) if prediction.instances is None else prediction.instances.numpy()
        labels = prediction.labels.numpy()
        if prediction.boxes is not None:  # a thing has one class, whatever its pixels have
            labels = np.where(given > 0, np.array([IGNORE, *(label for label, _ in prediction.boxes)])[given], labels)
        truth, found = (target.labels[0].numpy(), numbers), (labels, given)
        scores = replace(scores, segments=count_segments(truth, found, target.classes, self.panoptic))
        if prediction.boxes is None or prediction.level_from_world is None:
            return scores
        shown = [
            (views[position], frames[position].things(views[position], task.fit)) for position in task.sample.contexts
        ]
        boxes = true_boxes(shown, target.classes, prediction.level_from_world)
        return replace(scores, boxes=None if boxes is None else count_boxes(boxes, prediction.boxes))


def _keep_extremes(frames: list[tuple[FrameScores, Prediction]]) -> list[tuple[FrameScores, Prediction]]:
    """The frames so far that may still be among those shown."""
    best, worst = find_extremes([frame for frame, _ in frames], SHOWN)
    return [frames[position] for position in sorted([*best, *worst])]


def _combine(
    views: int, targets: Sequence[_TargetScores], shown: Sequence[tuple[FrameScores, Prediction]]
) -> MethodScores:
    """The scores for one number of views."""
    baselines = {"copy": tuple(target.copy for target in targets)}
    if any(target.one_pass is not None for target in targets):
        baselines = {
            "one_pass": tuple(target.one_pass for target in targets if target.one_pass is not None)
        } | baselines
    if any(target.warp is not None for target in targets):
        baselines["warp"] = tuple(target.warp for target in targets if target.warp is not None)
    labelled = [(target.copy, target.copy.truth) for target in targets if target.copy.truth is not None]
    if labelled:
        matrices = predict_majority([truth for _, truth in labelled])
        baselines["majority"] = tuple(
            FrameScores(frame.scene, frame.target, frame.contexts, confusion=matrix, truth=truth)
            for (frame, truth), matrix in zip(labelled, matrices, strict=True)
        )
    truth_hash = _hash_all([target.truth for target in targets])
    predictions = {(frame.scene, frame.target): prediction for frame, prediction in shown}
    return MethodScores(views, tuple(target.method for target in targets), baselines, truth_hash, predictions)


def hash_truths(plan: FramePlan) -> dict[int, str]:
    """The hashes that `MethodScores.truth` would have now, by number of views: the true labels and depths are read again.

    Raises:
        InputError: a frame cannot be used.
    """
    tasks = {task.truth_stem: task for task in plan.tasks}
    each = {stem: _hash_truth(read_frame(task, task.sample.target, INDOOR_DEPTH_RANGE)) for stem, task in tasks.items()}
    return {
        views: _hash_all([each[task.truth_stem] for task in plan.tasks if task.views == views]) for views in plan.views
    }


def _hash_all(hashes: Sequence[str]) -> str:
    """The hash of all targets from that of each."""
    return hashlib.sha256("".join(hashes).encode()).hexdigest()


def _hash_truth(view: Views) -> str:
    """A hash of a view's labels and depths."""
    digest = hashlib.sha256()
    for maps in (view.labels, view.depths):
        digest.update(b"none" if maps is None else np.ascontiguousarray(maps.numpy()).tobytes())
    return digest.hexdigest()
