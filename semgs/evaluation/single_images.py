"""Scores of classes in single images, each classified by itself, without cameras and without rendering.

OUT/report.json                   all scores (those of further trials under "rows"), with 95 % intervals over scenes, or over images of fewer than five; images without cameras count as a scene each
OUT/predictions/SCENE/STEM.png    the likeliest class of each pixel, at the size that was compared
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import asdict, dataclass, replace
from functools import partial
from pathlib import Path
from typing import Any, final

import cv2
import numpy as np
import torch
from jaxtyping import Float32, UInt8

from semgs.data.bounds.depth_range import DepthRange
from semgs.data.resampling import default_size
from semgs.data.scene import Scene
from semgs.data.tables.classes import IGNORE, ClassTable
from semgs.data.views import INDOOR_DEPTH_RANGE
from semgs.evaluation.frames.frame_plan import distinct_stems
from semgs.evaluation.scoring.frame_scores import FrameScores
from semgs.evaluation.scoring.intervals import choose_units, intervals, units_in_words
from semgs.evaluation.scoring.score_records import encode_scores
from semgs.evaluation.scoring.summary import CLASS_METRICS, CONFIDENCE_METRICS, ClassScores, score_classes, summarise
from semgs.evaluation.tables.environment import hardware, versions
from semgs.evaluation.tables.evaluation_report import SINGLE_FORMAT, VERSION, EvaluatedMethod
from semgs.evaluation.tables.table_grid import Cell, Grid, interval_cells, printed
from semgs.files.atomic import write_json
from semgs.files.errors import InputError
from semgs.files.folders import own_folder
from semgs.files.images.pictures import write_png
from semgs.files.text import counted
from semgs.model.semgs import SemGS
from semgs.objectives.measures import TITLES, shown_number
from semgs.objectives.metrics import confusion_matrix
from semgs.objectives.selective import counts_by_confidence
from semgs.rendering.rendering import likeliest
from semgs.rendering.temperatures import highest_probability
from semgs.segmenters.class_map_files import Photos
from semgs.segmenters.class_source import ClassSource, Segmenter, Translated
from semgs.segmenters.labelling import Labelling
from semgs.sources.source import MadeBy

METRICS = (*(name for name in CLASS_METRICS if name != "not_given"), *CONFIDENCE_METRICS)
SHOWN = ("miou", "miou_per_image", "accuracy", "class_accuracy", "aurc", "ece")
"""The columns of the printed table."""

NO_DEPTH = DepthRange(*INDOOR_DEPTH_RANGE, "unknown", "classes of single images do not depend on it")


@dataclass(frozen=True)
class Trial:
    """A way to classify the images, a row of the table.

    Attributes:
        side: short side at which images are read, classified and compared [px]; None for the size at which `semgs reconstruct` would
            read each, and for the full image if a segmenter classifies it.
        flip: take the mean of each image and its mirror image.
    """

    side: int | None = None
    flip: bool = False

    def __str__(self) -> str:
        words = [f"{self.side} px"] * (self.side is not None) + ["flipped"] * self.flip
        return f" at {', '.join(words)}" if words else ""

    def size(self, full: tuple[int, int]) -> tuple[int, int]:
        """The (height, width) at which an image of a size is read: multiples of 16 [px]."""
        if self.side is None:
            return default_size(full)
        height, width = (max(1, round(length * self.side / min(full) / 16)) * 16 for length in full)
        return height, width


def evaluate_single_images(
    out: Path,
    network: SemGS,
    subject: EvaluatedMethod,
    scenes: Sequence[Scene],
    size: tuple[int, int] | None = None,
    *,
    overwrite: bool = False,
    done: Callable[[int], object] = lambda count: None,
    trials: Sequence[Trial] = (Trial(),),
    labelling: Callable[[Scene], Labelling] | None = None,
) -> str:
    """Score every labelled image of some scenes and write the folder, which appears only once it is complete.

    Args:
        out: the output folder.
        network: in evaluation mode, with the class table of the labels.
        subject: its description for the report.
        scenes: with labels, with or without cameras.
        size: (height, width) to compare at; None for the size at which `semgs reconstruct` would read each image.
        overwrite: replace the folder if an earlier evaluation wrote it.
        done: called after each image with the number of finished images, of all trials.
        trials: the rows of the table; the folder has the predictions of the first.
        labelling: gives the classes instead of the network; None for none.

    Returns:
        The tables to print.

    Raises:
        InputError: an image or the folder cannot be used.
    """
    classes = network.classes
    assert classes is not None
    with own_folder(out, "evaluate", overwrite) as folder:
        rows: dict[str, list[FrameScores]] = {}
        for number, trial in enumerate(trials):
            rows[f"{subject.name}{trial}"] = score_single_images(
                network,
                scenes,
                size,
                None if number else folder / "predictions",
                partial(_done_after, done, sum(map(len, rows.values()))),
                trial,
                labelling,
            )
        frames = next(iter(rows.values()))
        device = next(network.parameters()).device.type
        numbers = single_numbers(subject, scenes, frames, classes, device)
        write_json(folder / "report.json", numbers | {"rows": {name: _scores(found) for name, found in rows.items()}})
    return "\n\n".join(printed(grid, "text") for grid in single_grids(rows, classes))


@final
@dataclass(frozen=True)
class _Tried:
    """A segmentation network that gets its images as a trial says.

    Attributes:
        network: the network.
        trial: short side of the images, and whether their mirror images count.
    """

    network: Segmenter
    trial: Trial

    @property
    def classes(self) -> ClassTable:
        """Those of the network."""
        return self.network.classes

    @property
    def made_by(self) -> MadeBy:
        """The network."""
        return self.network.made_by

    def __call__(self, image: UInt8[np.ndarray, "h w 3"]) -> Float32[np.ndarray, "class rows columns"]:
        """As `Segmenter`."""
        if self.trial.side is not None:
            height, width = self.trial.size(image.shape[:2])
            image = np.asarray(cv2.resize(image, (width, height), interpolation=cv2.INTER_AREA))
        found = self.network(image)
        if not self.trial.flip:
            return found
        return (found + self.network(np.ascontiguousarray(image[:, ::-1]))[..., ::-1]) / 2


def tried(source: ClassSource, trial: Trial) -> ClassSource:
    """A source whose network gets its images as a trial says. Maps of files are compared at that size.

    Raises:
        InputError: the trial needs mirror images, and the source has maps of files.
    """
    if isinstance(source, Translated):
        return replace(source, source=tried(source.source, trial))
    if isinstance(source, Photos):
        return replace(source, segmenter=_Tried(source.segmenter, trial))
    if trial.flip:
        raise InputError(source.title, "a network, which can classify mirror images", "maps of the images as they are")
    return source


def _done_after(done: Callable[[int], object], before: int, count: int) -> None:
    """Count on from the images of earlier trials."""
    done(before + count)


@torch.no_grad()
def score_single_images(
    network: SemGS,
    scenes: Sequence[Scene],
    size: tuple[int, int] | None = None,
    predictions: Path | None = None,
    done: Callable[[int], object] = lambda count: None,
    trial: Trial = Trial(),
    labelling: Callable[[Scene], Labelling] | None = None,
) -> list[FrameScores]:
    """The scores of every labelled image of some scenes, in order; arguments as for `evaluate_single_images`.

    Args:
        predictions: the folder for predicted classes; None writes none.
        trial: how images are read, if there is no `size`.
    """
    device = next(network.parameters()).device
    temperature = None if network.temperatures is None else network.temperatures.gaussians
    scores: list[FrameScores] = []
    for scene in scenes:
        source = None if labelling is None else tried(labelling(scene).source, trial)
        labelled_frames = {index: frame for index, frame in enumerate(scene.frames) if frame.labels is not None}
        stems = distinct_stems({index: frame.name for index, frame in labelled_frames.items()})
        for index, frame in labelled_frames.items():
            stem = stems[index]
            view = scene.read([index], size or trial.size(frame.lens.size), NO_DEPTH)
            assert view.labels is not None
            if source is not None:
                distributions = source.of(frame, view.size, "crop")
            else:
                distributions = network.classify(view.to(device), alone=True)[0].cpu()
                if trial.flip:
                    mirrored = view.map(lambda maps: maps.flip(-1)).to(device)
                    distributions = (distributions + network.classify(mirrored, alone=True)[0].cpu().flip(-1)) / 2
            predicted, labels = likeliest(distributions), view.labels[0]
            labelled = labels != IGNORE
            confidence = highest_probability(distributions.permute(1, 2, 0)[labelled], temperature)
            scores.append(
                FrameScores(
                    scene=scene.name if scene.posed else f"{scene.name}/{stem}",
                    target=stem,
                    contexts=(stem,),
                    confusion=confusion_matrix(predicted, labels, len(view.classes)).numpy(),
                    truth=np.bincount(labels[labelled].numpy(), minlength=len(view.classes)).astype(np.int64),
                    confidences=counts_by_confidence(confidence, (predicted == labels)[labelled]),
                )
            )
            if predictions is not None:
                (predictions / scene.name).mkdir(parents=True, exist_ok=True)
                write_png(predictions / scene.name / f"{stem}.png", predicted.numpy())
            done(len(scores))
    return scores


def single_numbers(
    subject: EvaluatedMethod,
    scenes: Sequence[Scene],
    frames: Sequence[FrameScores],
    classes: ClassTable,
    device: str = "cpu",
) -> dict[str, Any]:
    """All numbers of the report, ready for JSON."""
    return {
        "format": SINGLE_FORMAT,
        "version": VERSION,
        "method": asdict(subject),
        "data": [{"name": scene.name, "layout": scene.layout, "images": len(scene)} for scene in scenes],
        "classes": {"name": classes.name, "names": list(classes.names)},
        "images": len(frames),
        **_scores(frames),
        "per_class": [
            {"name": name, **asdict(scores)} for name, scores in zip(classes.names, score_classes(frames), strict=False)
        ],
        "per_image": [encode_scores(frame) for frame in frames],
        "versions": versions(),
        "hardware": hardware(device),
    }


def _scores(frames: Sequence[FrameScores]) -> dict[str, Any]:
    """The metrics, with their intervals."""
    values, bounds = summarise(frames), intervals(frames)
    ends = {name: [bounds[name].low, bounds[name].high] for name in METRICS if name in bounds}
    return {**{name: values.get(name) for name in METRICS}, "intervals": ends}


def single_grids(rows: Mapping[str, Sequence[FrameScores]], classes: ClassTable) -> list[Grid]:
    """The scores of each row with their intervals, and the IoU of each class of the first."""
    frames = next(iter(rows.values()))
    scored = zip(classes.names, score_classes(frames), strict=False)
    total = sum(int(frame.truth.sum()) for frame in frames if frame.truth is not None)
    return [
        Grid(
            title="Single images",
            groups=(),
            head=(counted(len(frames), "image"), *(TITLES[metric] for metric in SHOWN)),
            rows=tuple((Cell(name), *interval_cells(_scores(found), SHOWN)) for name, found in rows.items()),
            notes=(
                f"In brackets: 95 % intervals over {units_in_words([choose_units(frames)])}; images without cameras count as a scene each.",
            ),
        ),
        Grid(
            title="Classes",
            groups=(),
            head=("class", "pixels", "IoU", "class acc."),
            rows=tuple(_class_row(label, scores, total) for label, scores in scored if scores.pixels),
        ),
    ]


def _class_row(label: str, scores: ClassScores, total: int) -> tuple[Cell, ...]:
    """A row of the table of classes."""
    figures = (shown_number("miou", scores.iou), shown_number("accuracy", scores.accuracy))
    return (Cell(label), Cell(f"{100 * scores.pixels / total:.1f} %"), *map(Cell, figures))
