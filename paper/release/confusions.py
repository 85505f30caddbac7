"""Which classes weights get wrong in real photos, and what they take them for: a part of the section "Failures" of docs/model_card.md.

It only reads reports of `semgs evaluate`, with `--single` or from one number of views, so it needs no photos and no weights.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from paper.release.failures import ClassMistake, mistakes
from paper.release.pages import CARD, write_between
from semgs.evaluation.scoring.frame_scores import FrameScores
from semgs.evaluation.scoring.summary import sum_confusions, summarise
from semgs.evaluation.tables.saved_report import read_report
from semgs.files.errors import InputError
from semgs.model.weights.index import SHOWN

BEGIN, END = "<!-- confusions -->", "<!-- end of confusions -->"
"""Markers of these tables in the model card."""

PHOTOS, PIXELS, RIGHT = 3, 5_000, 0.8
"""A class fails if at least so many photos show it, with at least so many labelled pixels together, and a smaller share of these is right."""

ROWS, COMMONEST = 12, 5
"""Lines of a table, and mistakes in the sentence before it, at most."""

HEAD = ("| what it is | right | most often taken for | mostly wrong in | pixels |", "|---|---:|---|---:|---:|")


@dataclass(frozen=True)
class ClassFailure:
    """How often a class is right, and what it is most often taken for.

    Attributes:
        name: of the class.
        right: share of its pixels that are right, 0..1.
        largest: its most frequent mistake; None if all its pixels are right or without a predicted class.
        wrong: number of photos in which less than half of its pixels are right.
        photos: number of photos that show it.
        pixels: number of its pixels.
    """

    name: str
    right: float
    largest: ClassMistake | None
    wrong: int
    photos: int
    pixels: int


@dataclass(frozen=True, eq=False)
class ScoredPhotos:
    """What a report says of photos with labels.

    Attributes:
        frames: the scores of each.
        names: of the classes.
        sha256: of the weights.
    """

    frames: tuple[FrameScores, ...]
    names: tuple[str, ...]
    sha256: str


def write_confusions(reports: Mapping[str, Path], card: Path = CARD) -> str:
    """Write a table for each report into the card; returns the text.

    Args:
        reports: files, or the output folders of evaluations, of the same weights, by title.
        card: the page to write into.

    Raises:
        InputError: a report cannot be used.
    """
    text = confusions_text({title: read_photos(path) for title, path in reports.items()})
    write_between(card, text, BEGIN, END)
    return text


def read_photos(path: Path) -> ScoredPhotos:
    """The labelled photos in a report of `semgs evaluate`.

    Raises:
        InputError: the file cannot be read, is no report of weights, has several numbers of views, or scores no classes.
    """
    report = read_report(path)
    if len(report.results) != 1:
        raise InputError(report.path, "one number of views", f"{len(report.results)}", key="results")
    frames = [frame for result in report.results.values() for frame in result.frames]
    labelled = tuple(one for one in frames if one.confusion is not None and one.truth is not None)
    if not labelled:
        raise InputError(report.path, "scores of labelled photos", "none")
    if report.sha256 is None:
        raise InputError(report.path, "a report of weights", "one of predictions")
    return ScoredPhotos(labelled, report.class_names, report.sha256)


def confusions_text(reports: Mapping[str, ScoredPhotos]) -> str:
    """The text for the card.

    Raises:
        InputError: the reports are of different weights.
    """
    sha256, *others = dict.fromkeys(one.sha256 for one in reports.values())
    if others:
        raise InputError("confusions", "reports of the same weights", f"{sha256[:SHOWN]} and {others[0][:SHOWN]}")
    parts = [
        f"Weights {sha256[:SHOWN]}. Each table has the classes of which less than {100 * RIGHT:.0f} % of the pixels are right, the worst first, "
        f"at most {ROWS}. Classes with fewer than {PIXELS:,} labelled pixels, or in fewer than {PHOTOS} photos, are left out."
    ]
    for title, one in reports.items():
        scores, common = summarise(one.frames), mistakes(one.frames, one.names)[:COMMONEST]
        taken = ", ".join(f"{each.true} → {each.given} {100 * each.share:.1f} %" for each in common)
        parts += [
            f"**{title}**: {len(one.frames)} photos, mIoU {scores['miou']:.3f}, accuracy {scores['accuracy']:.3f}. "
            f"The commonest mistakes, of all labelled pixels: {taken or 'none'}.",
            failures_table(class_failures(one.frames, one.names)[:ROWS]),
        ]
    return "\n\n".join(parts)


def class_failures(frames: Sequence[FrameScores], names: Sequence[str]) -> tuple[ClassFailure, ...]:
    """The classes that fail, the one with the smallest share of right pixels first.

    Args:
        frames: with labels, at least one.
        names: of the classes.
    """
    confusion, truth = sum_confusions(frames)
    largest = {one.true: one for one in reversed(mistakes(frames, names))}
    pixels = np.stack([frame.truth for frame in frames if frame.truth is not None])
    right = np.stack([frame.confusion.diagonal() for frame in frames if frame.confusion is not None])
    photos, wrong = (pixels > 0).sum(0), (2 * right < pixels).sum(0)
    found = [
        ClassFailure(
            name=names[label],
            right=float(confusion[label, label] / truth[label]),
            largest=largest.get(names[label]),
            wrong=int(wrong[label]),
            photos=int(photos[label]),
            pixels=int(truth[label]),
        )
        for label in np.flatnonzero(
            (photos >= PHOTOS) & (truth >= PIXELS) & (confusion.diagonal() < RIGHT * truth)
        ).tolist()
    ]
    return tuple(sorted(found, key=lambda one: one.right))


def failures_table(failures: Sequence[ClassFailure]) -> str:
    """A row for each class, in Markdown."""
    rows = []
    for one in failures:
        taken = "" if one.largest is None else f"{one.largest.given}, {100 * one.largest.of_class:.0f} %"
        wrong = f"{one.wrong} of {one.photos} photos"
        rows.append(f"| {one.name} | {100 * one.right:.0f} % | {taken} | {wrong} | {one.pixels:,} |")
    return "\n".join([*HEAD, *rows])
