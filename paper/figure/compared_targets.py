"""The paper's comparison figures: the predictions of several methods for some targets, with the inputs and the truth."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from typing import Any

from jaxtyping import UInt8
from torch import Tensor

from paper.figure.comparison import FigureBlock, PictureRow, mosaic
from semgs.data.spread import spread
from semgs.data.tables.classes import IGNORE, ClassTable
from semgs.data.views import Views
from semgs.evaluation.frames.frame_plan import FramePlan, Task
from semgs.evaluation.frames.predictions import Method, Prediction
from semgs.evaluation.frames.reading import make_inputs, read_views
from semgs.evaluation.scoring.frame_scores import score
from semgs.evaluation.scoring.score_records import finite
from semgs.evaluation.scoring.summary import summarise
from semgs.figures.class_images import LegendEntry, class_picture, legend, true_class_picture
from semgs.figures.view_images import as_bytes
from semgs.files.errors import InputError

VISIBLE = 0.001
"""Classes with a smaller share of all pixels are not in the legend."""


@dataclass(frozen=True, eq=False)
class ComparedTarget:
    """One target with the predictions of all methods.

    Attributes:
        task: the target.
        contexts: the input views, in order.
        target: the truth, one view.
        predictions: of each method, in the order of the columns.
        classes: their class table.
    """

    task: Task
    contexts: Views
    target: Views
    predictions: tuple[Prediction, ...]
    classes: ClassTable


def choose_tasks(plan: FramePlan, rows: int, wanted: Sequence[str] = ()) -> tuple[Task, ...]:
    """The targets that a figure shows.

    Args:
        plan: of one number of views.
        rows: how many targets; they are spread evenly over the plan, so they are not hand-picked.
        wanted: names of targets ("scene0160_00/22") to show instead.

    Raises:
        ValueError: the plan has no target of a given name.
    """
    if wanted:
        known = {task.truth_stem: task for task in plan.tasks}
        for name in wanted:
            if name not in known:
                raise ValueError(f"there is no target {name!r}; the first one is {next(iter(known))!r}")
        return tuple(known[name] for name in wanted)
    return tuple(spread(plan.tasks, rows))


def compare_methods(
    task: Task, methods: Sequence[Method], classes: ClassTable, depth_range: tuple[float, float] | None = None
) -> ComparedTarget:
    """Predict a target with every method.

    Args:
        task: the target; its scene may have no labels.
        methods: the columns.
        classes: the class table of all methods.
        depth_range: near and far to give them; None uses the bounds of the scene.

    Raises:
        InputError: a file cannot be used, or a method predicts no classes.
    """
    labelled = task.scene.classes is not None
    if not labelled:
        task = replace(task, scene=replace(task.scene, classes=classes))  # predictions are read in that table
    views = read_views(task, depth_range)
    inputs = make_inputs(task, views)
    predictions = tuple(method.predict(inputs) for method in methods)
    for method, prediction in zip(methods, predictions, strict=True):
        if prediction.labels is None:
            raise InputError(task.scene.path, f"classes of {task.truth_stem} from {method.name}", "none")
    return ComparedTarget(task, inputs.contexts, views[task.sample.target], predictions, classes)


@dataclass(frozen=True, eq=False)
class FigurePart:
    """What a figure shows of one data set.

    Attributes:
        title: of the data.
        plan: the targets.
        methods: in the order of the columns.
        classes: the class table of all methods.
    """

    title: str
    plan: FramePlan
    methods: tuple[Method, ...]
    classes: ClassTable

    @property
    def columns(self) -> tuple[str, ...]:
        """The headings of the methods."""
        return tuple(method.name for method in self.methods)

    def compare(self) -> Iterator[ComparedTarget]:
        """Predict the targets with every method, one target after the other; raises as `compare_methods`."""
        for task in self.plan.tasks:
            yield compare_methods(task, self.methods, self.classes, self.plan.depth_range)


def comparison_block(title: str, frames: Sequence[ComparedTarget], names: Sequence[str]) -> FigureBlock:
    """The block of some targets: inputs, each method, truth. If no target is labelled, its photo replaces the truth.

    Args:
        title: of the block.
        frames: at least one.
        names: of the methods.
    """
    labelled = any(one.target.labels is not None for one in frames)
    rows = []
    for one in frames:
        inputs = mosaic([as_bytes(image) for image in one.contexts.images])
        said = [
            class_picture(prediction.labels.numpy(), one.classes)
            for prediction in one.predictions
            if prediction.labels is not None
        ]
        truth = true_class_picture(one.target.labels[0].numpy(), one.classes) if one.target.labels is not None else None
        last = truth if labelled else as_bytes(one.target.images[0])
        rows.append(PictureRow(one.task.truth_stem, (inputs, *said, last)))
    last_heading = "ground truth" if labelled else "photo (no truth)"
    return FigureBlock(title, ("inputs", *names, last_heading), tuple(rows))


def comparison_legend(frames: Sequence[ComparedTarget]) -> tuple[LegendEntry, ...]:
    """The classes with a visible share of truth and predictions, the most frequent first; empty without frames."""
    maps = [
        prediction.labels.numpy() for one in frames for prediction in one.predictions if prediction.labels is not None
    ]
    maps += [one.target.labels[0].numpy() for one in frames if one.target.labels is not None]
    return tuple(entry for entry in legend(maps, frames[0].classes) if entry.share >= VISIBLE) if frames else ()


def comparison_numbers(frames: Sequence[ComparedTarget], names: Sequence[str]) -> list[dict[str, Any]]:
    """The scores of each method for each target of a figure, ready for JSON: mIoU, accuracy and, as `torn`, the label noise; None without truth."""
    listed = []
    for one in frames:
        methods = {}
        for name, prediction in zip(names, one.predictions, strict=True):
            values = summarise([score(one.task, prediction, one.target)])
            assert prediction.labels is not None
            methods[name] = {
                "miou_per_image": finite(values.get("miou_per_image")),
                "accuracy": finite(values.get("accuracy")),
                "torn": None if one.target.labels is None else label_noise(prediction.labels, one.target.labels[0]),
            }
        task = one.task
        contexts = list(task.contexts)
        listed.append({"scene": task.scene.name, "target": task.target, "contexts": contexts, "methods": methods})
    return listed


def label_noise(predicted: UInt8[Tensor, "h w"], truth: UInt8[Tensor, "h w"]) -> float | None:
    """How noisy a class map is: the share of neighbouring pixels with the same true class that have different predicted classes.

    Neighbours are below and to the right, as in the paper's regional smoothness. Pixels with unknown truth do not count.

    Returns:
        0 (no noise) to 1; None if no two neighbours have the same true class.
    """
    pairs = different = 0
    for axis in (0, 1):
        length = truth.shape[axis] - 1
        first, second = truth.narrow(axis, 0, length), truth.narrow(axis, 1, length)
        together = (first == second) & (first != IGNORE)
        apart = predicted.narrow(axis, 0, length) != predicted.narrow(axis, 1, length)
        pairs += int(together.sum())
        different += int((together & apart).sum())
    return different / pairs if pairs else None
