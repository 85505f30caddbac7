"""Evaluate: a plan and a method in; scores of every target, its own and those of the trivial rows, out."""

from __future__ import annotations

import hashlib
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np
from torch.utils.data import DataLoader, Dataset

from semgs.data.views import Views
from semgs.data.workers import settle_worker
from semgs.evaluation.frames.plan import Plan, Task
from semgs.evaluation.frames.predictions import Method, Prediction, write_maps, write_prediction
from semgs.evaluation.frames.protocols import nearest_first
from semgs.evaluation.frames.reading import inputs_of, read_views
from semgs.evaluation.scoring.baselines import copied, majority, warped
from semgs.evaluation.scoring.scores import FrameScores, score
from semgs.evaluation.scoring.similarity import perceptual_distance
from semgs.evaluation.scoring.summary import extremes
from semgs.files.errors import InputError
from semgs.model.memory_plan import NotEnoughMemoryError

PREDICTIONS = "predictions"
"""Folder of what a method said, in the form that `--predictions` reads."""
TRUTH = "truth"
"""Folder of the true labels at the size of the evaluation."""
SHOWN = 10
"""So many of the best targets and of the worst are shown in the report, for each number of views."""


@dataclass(frozen=True, eq=False)
class Rows:
    """The scores of all targets of one number of views, in the order of the plan.

    Attributes:
        views: the number of contexts.
        method: the scores of what is evaluated.
        trivial: those of the trivial rows, by the names of `semgs.evaluation.scoring.baselines.NAMES`; a row that some scene
            lacks the truth for has fewer targets, or is absent.
        truth: a hash of the true labels and depths that the targets were compared with; not of the pictures, whose
            resizing may differ in the last bit between machines.
        shown: what the method said of the `SHOWN` best and worst targets, by scene and target.
    """

    views: int
    method: tuple[FrameScores, ...]
    trivial: dict[str, tuple[FrameScores, ...]]
    truth: str
    shown: dict[tuple[str, str], Prediction] = field(default_factory=dict)


def evaluate(
    plan: Plan,
    method: Method,
    folder: Path,
    *,
    save: bool = True,
    workers: int = 0,
    done: Callable[[int], object] = lambda count: None,
) -> list[Rows]:
    """Score a method and the trivial rows on every target of a plan.

    Args:
        plan: what to compare.
        method: what to evaluate.
        folder: existing; true labels are written to `truth/` in it and, with `save`, predictions to `predictions/`.
        save: write what the method says.
        workers: processes that evaluate targets side by side, each on one thread; 0 uses this process and its threads.
        done: told after each target how many there have been.

    Raises:
        InputError: a frame or prediction cannot be used.
        NotEnoughMemoryError: the network needs more memory than there is.
        OSError: the disk is full.
    """
    targets = DataLoader(
        _Targets(plan, method, folder, save),
        batch_size=None,
        num_workers=workers,
        # A forked process in which numba has run its threads dies at its next kernel.
        multiprocessing_context="forkserver" if workers else None,
        worker_init_fn=settle_worker,
    )
    judged: dict[int, list[_Judged]] = {views: [] for views in plan.views}
    shown: dict[int, list[tuple[FrameScores, Prediction]]] = {views: [] for views in plan.views}
    for count, one in enumerate(targets, 1):
        if isinstance(one, Exception):
            raise one
        found, prediction = one
        views = len(found.method.contexts)
        judged[views].append(found)
        # A copy: what another process sent stays a file of shared memory, which would be kept open.
        shown[views] = _kept([*shown[views], (found.method, prediction.copy())])
        done(count)
    return [_rows(views, judged[views], shown[views]) for views in plan.views]


@dataclass(frozen=True, eq=False)
class _Judged:
    """One target: the method's scores, those of copy and warp, and a hash of the truth."""

    method: FrameScores
    copy: FrameScores
    warp: FrameScores | None
    truth: str


class _Targets(Dataset):
    """The targets of a plan, judged when they are asked for.

    A file that cannot be used, a full disk, or too little memory is returned and not raised: a loader hands on no more than an error's text.
    """

    def __init__(self, plan: Plan, method: Method, folder: Path, save: bool) -> None:
        self._plan, self._method, self._folder, self._save = plan, method, folder, save
        self._perceptual = perceptual_distance()

    def __len__(self) -> int:
        return len(self._plan.tasks)

    def __getitem__(self, index: int) -> tuple[_Judged, Prediction] | InputError | OSError | NotEnoughMemoryError:
        """Judge a target: its scores, and what the method said."""
        try:
            return self._judge(self._plan.tasks[index])
        except (InputError, OSError, NotEnoughMemoryError) as error:
            return error

    def _judge(self, task: Task) -> tuple[_Judged, Prediction]:
        """Read, predict, write, score."""
        views = read_views(task, self._plan.depth_range)
        target = views[task.sample.target]
        prediction = self._method.predict(inputs_of(task, views))
        if self._save:
            write_prediction(self._folder / PREDICTIONS, task, prediction)
        if target.labels is not None:
            write_maps(self._folder / TRUTH, task.truth_stem, Prediction(labels=target.labels[0]), metric=True)
        ordered = [views[position] for position in nearest_first(task.scene, task.sample)]
        moved = warped(ordered, target)
        judged = _Judged(
            method=score(task, prediction, target, self._perceptual),
            copy=score(task, copied(ordered[0]), target, self._perceptual),
            warp=None if moved is None else score(task, moved, target, self._perceptual),
            truth=_digest(target),
        )
        return judged, prediction


def _kept(frames: list[tuple[FrameScores, Prediction]]) -> list[tuple[FrameScores, Prediction]]:
    """Those of the frames so far that may be shown at the end."""
    best, worst = extremes([frame for frame, _ in frames], SHOWN)
    return [frames[position] for position in sorted([*best, *worst])]


def _rows(views: int, judged: Sequence[_Judged], shown: Sequence[tuple[FrameScores, Prediction]]) -> Rows:
    """The rows of one number of views."""
    trivial = {"copy": tuple(one.copy for one in judged)}
    if any(one.warp is not None for one in judged):
        trivial["warp"] = tuple(one.warp for one in judged if one.warp is not None)
    labelled = [(one.copy, one.copy.truth) for one in judged if one.copy.truth is not None]
    if labelled:
        matrices = majority([truth for _, truth in labelled])
        trivial["majority"] = tuple(
            FrameScores(frame.scene, frame.target, frame.contexts, confusion=matrix, truth=truth)
            for (frame, truth), matrix in zip(labelled, matrices, strict=True)
        )
    together = hashlib.sha256("".join(one.truth for one in judged).encode()).hexdigest()
    said = {(frame.scene, frame.target): prediction for frame, prediction in shown}
    return Rows(views, tuple(one.method for one in judged), trivial, together, said)


def _digest(view: Views) -> str:
    """A hash of a view's labels and depths."""
    digest = hashlib.sha256()
    for maps in (view.labels, view.depths):
        digest.update(b"none" if maps is None else np.ascontiguousarray(maps.numpy()).tobytes())
    return digest.hexdigest()
