"""Where weights fail and which classes they confuse: docs/images/failures.jpg and the section "Failures" of docs/model_card.md.

The rooms are generated here from the validation seed, in the style `other`, which nothing is trained on, and without assets, so there
are no licences to respect. The same weights give the same bytes on the same machine.
"""

from __future__ import annotations

import io
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from tempfile import TemporaryDirectory

import numpy as np
from PIL import Image

from paper.figure.compared_targets import ComparedTarget, FigurePart, comparison_legend
from paper.figure.comparison import FigureBlock, PictureRow, comparison
from paper.release.pages import CARD, DOCS, write_between
from semgs.data.scenes import open_scenes
from semgs.data.tables.classes import SCANNET20
from semgs.evaluation.frames.frame_plan import make_plan
from semgs.evaluation.frames.protocols import neighbours
from semgs.evaluation.run import load_candidate
from semgs.evaluation.scoring.frame_scores import FrameScores, score
from semgs.evaluation.scoring.summary import sum_confusions, summarise
from semgs.figures.class_images import class_picture, true_class_picture
from semgs.figures.view_images import as_bytes
from semgs.files.atomic import write_bytes
from semgs.files.errors import InputError, input_error
from semgs.files.images.colours import depth_limits, depth_picture
from semgs.model.weights.index import SHOWN
from semgs.training.data.data_settings import VALIDATION_SEED
from semgs_rooms.sets.dataset import RoomSettings, write_dataset

BEGIN, END = "<!-- failures -->", "<!-- end of failures -->"
"""Markers of the failures in the model card."""

HEADINGS = ("truth", "picture", "true classes", "classes", "depth")
"""Column headings of the sheet."""

WIDTH = 1200
"""Width of the sheet [px]."""

QUALITIES = range(95, 45, -5)
"""JPEG qualities to try, best first."""

PICTURE = DOCS / "images" / "failures.jpg"

SCENES, SIZE, FRAMES, VIEWS = 16, (240, 320), 4, 2
"""Number of rooms, (height, width) of their frames [px], frames per room, and input views for each target (the inner frames)."""

ROWS, MISTAKES, BYTES = 5, 8, 200_000
"""Targets on the sheet, lines of the table, and the maximum file size of the sheet."""


@dataclass(frozen=True)
class ClassMistake:
    """A class that is mistaken for another.

    Attributes:
        true: the true class.
        given: the predicted class.
        share: of all labelled pixels, 0..1.
        of_class: share of the pixels of the true class, 0..1.
    """

    true: str
    given: str
    share: float
    of_class: float


@dataclass(frozen=True, eq=False)
class ScoredTarget:
    """A target, the prediction of one method, and its scores.

    Attributes:
        compared: the target with only this prediction.
        scores: of the prediction.
    """

    compared: ComparedTarget
    scores: FrameScores

    @property
    def miou(self) -> float:
        """Mean IoU over the classes in the target's truth."""
        return summarise([self.scores])["miou_per_image"]


def write_failures(weights: str, data: Path | None = None, out: Path | None = None) -> str:
    """Write the sheet and, unless `out` is given, the card; returns the text for the card.

    Args:
        weights: a file, or the name of included weights.
        data: labelled scenes to use instead of generated rooms.
        out: file for the sheet, instead of that of the card.

    Raises:
        InputError: weights or scenes cannot be used, or only one of `data` and `out` is given.
    """
    if (data is None) != (out is None):
        raise InputError("failures", "--data and --out together", "one of them")
    found, sha256 = targets(weights, data)
    text = card_text(found, sha256)
    write_bytes(out or PICTURE, sheet(worst(found, ROWS), BYTES))
    if out is None:
        write_between(CARD, text, BEGIN, END)
    return text


def targets(weights: str, data: Path | None) -> tuple[tuple[ScoredTarget, ...], str]:
    """Predictions and scores for all targets of some scenes, or of generated rooms; and the hash of the weights.

    Raises:
        InputError: the weights or scenes cannot be used, or no included weights have that name.
    """
    with TemporaryDirectory() as drawn:
        if data is None:
            write_dataset(drawn, RoomSettings(VALIDATION_SEED, SIZE, FRAMES, "other"), SCENES)
        scenes = open_scenes(data or drawn)
        classes = next((scene.classes for scene in scenes if scene.classes), SCANNET20)
        plan = make_plan("neighbours", neighbours, scenes, [VIEWS])
        with input_error(weights, "weights"):
            candidate = load_candidate(weights, classes, "cpu")
        found = score_targets(tuple(FigurePart("", plan, (candidate.method,), classes).compare()))
    if not found:
        raise InputError(data or drawn, "labelled scenes", "none with labels")
    return found, str(candidate.subject.sha256)


def card_text(found: tuple[ScoredTarget, ...], sha256: str) -> str:
    """The text for the card."""
    scores = [one.scores for one in found]
    scenes = len({one.scene for one in scores})
    return (
        f"{len(found)} targets in {scenes} rooms, weights {sha256[:SHOWN]}: mIoU {summarise(scores)['miou']:.3f}, "
        f"accuracy {summarise(scores)['accuracy']:.3f}. The commonest mistakes:\n\n{mistakes_table(found, MISTAKES)}"
    )


def score_targets(frames: Sequence[ComparedTarget]) -> tuple[ScoredTarget, ...]:
    """Targets with the scores of the first method's predictions, without targets that have no labels."""
    labelled = [frame for frame in frames if frame.target.labels is not None]
    return tuple(ScoredTarget(frame, score(frame.task, frame.predictions[0], frame.target)) for frame in labelled)


def worst(targets: Sequence[ScoredTarget], count: int) -> tuple[ScoredTarget, ...]:
    """The targets with the smallest mIoU, worst first; at most one per scene, because frames of one scene fail alike."""
    of_scene: dict[str, ScoredTarget] = {}
    for one in sorted(targets, key=lambda one: one.miou):
        of_scene.setdefault(one.scores.scene, one)
    return tuple(of_scene.values())[:count]


def mistakes(frames: Sequence[FrameScores], names: Sequence[str]) -> tuple[ClassMistake, ...]:
    """All confusions between classes with these names, those with the most pixels first."""
    confusion, truth = sum_confusions(frames)
    wrong = confusion.copy()
    np.fill_diagonal(wrong, 0)
    pairs = sorted(np.argwhere(wrong).tolist(), key=lambda pair: -wrong[tuple(pair)])
    mistakes = []
    for row, column in pairs:
        share, of_class = (float(wrong[row, column] / whole) for whole in (truth.sum(), truth[row]))
        mistakes.append(ClassMistake(names[row], names[column], share, of_class))
    return tuple(mistakes)


def caption(target: ScoredTarget, most: int = 3) -> str:
    """The caption of a target: its scores and its largest confusions."""
    values = summarise([target.scores])
    scores = [f"mIoU {target.miou:.2f}", f"accuracy {values['accuracy']:.2f}"]
    if "depth_abs_rel" in values:
        scores.append(f"depth error {values['depth_abs_rel']:.2f}")
    largest = mistakes([target.scores], target.compared.classes.names)[:most]
    taken = [f"{mistake.true} → {mistake.given} {100 * mistake.share:.0f} %" for mistake in largest]
    return "; ".join([", ".join(scores), *([", ".join(taken) + " of the labelled pixels"] if taken else [])])


def sheet(targets: Sequence[ScoredTarget], most_bytes: int) -> bytes:
    """A JPEG of some targets, each a row of images with its caption, with a legend of the classes below.

    Args:
        targets: at least one, with predicted classes and optionally colour and depth.
        most_bytes: maximum size of the file, which gets the best quality that fits.

    Raises:
        ValueError: there are no targets, or they do not fit.
    """
    block = FigureBlock("", HEADINGS, tuple(_row(one) for one in targets))
    png = comparison([block], comparison_legend([one.compared for one in targets]))["png"]
    with Image.open(io.BytesIO(png)) as opened:
        size = (WIDTH, round(opened.height * WIDTH / opened.width))
        pixels = opened.convert("RGB").resize(size, Image.Resampling.LANCZOS)
    for quality in QUALITIES:
        buffer = io.BytesIO()
        pixels.save(buffer, "JPEG", quality=quality, optimize=True, progressive=True)
        if buffer.tell() <= most_bytes:
            return buffer.getvalue()
    raise ValueError(f"{len(targets)} rows of pictures do not fit into {most_bytes} bytes; take fewer")


def mistakes_table(targets: Sequence[ScoredTarget], most: int) -> str:
    """The most frequent mistakes over all targets, in Markdown.

    Args:
        targets: at least one.
        most: rows.
    """
    found = mistakes([one.scores for one in targets], targets[0].compared.classes.names)[:most]
    rows = [f"| {one.true} | {one.given} | {100 * one.share:.1f} % | {100 * one.of_class:.0f} % |" for one in found]
    head = ["| what it is | taken for | of all labelled pixels | of its class |", "|---|---|---:|---:|"]
    return "\n".join([*head, *rows])


def _row(target: ScoredTarget) -> PictureRow:
    """The images of a target, in the order of `HEADINGS`."""
    one = target.compared
    said = one.predictions[0]
    assert one.target.labels is not None
    assert said.labels is not None
    span = said.depths if one.target.depths is None else one.target.depths[0]
    limits = depth_limits([] if span is None else [span.numpy()])
    pictures = (
        as_bytes(one.target.images[0]),
        None if said.image is None else as_bytes(said.image),
        true_class_picture(one.target.labels[0].numpy(), one.classes),
        class_picture(said.labels.numpy(), one.classes),
        None if said.depths is None else depth_picture(said.depths.numpy(), limits),
    )
    return PictureRow(one.task.truth_stem, pictures, caption(target))
