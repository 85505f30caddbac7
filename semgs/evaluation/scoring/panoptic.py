"""Panoptic quality, which scores classes and things together (Kirillov et al., CVPR 2019), and boxes of things.

A segment is all pixels of one class, or, for classes of things, those of one thing. Two segments of a class match if their IoU is above one half.

- "coco": each target by itself, as in COCO's panopticapi. Pixels without a true class, pixels of a thing's class that belong to no thing, and true segments
  smaller than `LEAST` of the image are void: they count nowhere, and a predicted segment that is mostly there is not wrong. Predicted segments as small are
  dropped. A pixel without a prediction is a missed one. Scores are means over the classes of all targets together.
- "eps3d": as scripts/evaluate_pq.py of EPS3D (Runsong123/EPS3D). `MARGIN` pixels of each side do not count. Segments span the targets of a scene
  that have the same input views; in such a group, classes below `RARE` of the pixels of truth or prediction are void in both, and what the prediction leaves void
  is not missed. Scores are means over the classes of a group, then over groups.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Literal

import numpy as np
from jaxtyping import Bool, Float64, Int64, Integer

from semgs.data.tables.classes import IGNORE, ClassTable
from semgs.data.views import Views
from semgs.geometry.cameras import back_project
from semgs.robotics.boxes import Box, box_of
from semgs.robotics.objects import STUFF

Rule = Literal["coco", "eps3d"]

LEAST = 0.001
"""Segments with less than this share of the image's pixels do not count ("coco")."""

MARGIN, RARE = 25, 0.005
"""Pixels cut off each side, and the share of the pixels below which a class is void ("eps3d")."""

OTHER = "other"
"""The class of everything else in tables of a few classes: no thing."""

NUMBER = 16
"""Bits of the number of a thing; its class stands above them."""

VOID = IGNORE << NUMBER

OVERLAPS = (0.25, 0.5)
"""IoU from which boxes match."""

THINNEST = 0.1
"""Boxes are compared as if no side was shorter: IoU of flat things, such as pictures, would depend on millimetres [m]."""


@dataclass(frozen=True, eq=False)
class Segments:
    """How many pixels the segments of truth and prediction share in a target.

    Attributes:
        rule: by which they count.
        classes: the number of classes.
        things: those that have things.
        pairs: true class, true thing, predicted class, predicted thing, pixels; class 255 is void, thing 0 is none.
    """

    rule: Rule
    classes: int
    things: tuple[int, ...]
    pairs: Int64[np.ndarray, "n 5"]


def thing_classes(classes: ClassTable) -> tuple[int, ...]:
    """The classes of a table that have things: all but walls, floors and ceilings, as in ScanNet's benchmark, and a class of everything else."""
    return tuple(label for label, name in enumerate(classes.names) if name not in (*STUFF, OTHER))


def count_segments(
    truth: tuple[Integer[np.ndarray, "h w"], Integer[np.ndarray, "h w"]],
    prediction: tuple[Integer[np.ndarray, "h w"], Integer[np.ndarray, "h w"]],
    classes: ClassTable,
    rule: Rule = "coco",
) -> Segments:
    """The pixels that segments share.

    Args:
        truth, prediction: the class of each pixel, 255 = none, and the number of its thing, 0 = none.
        classes: the table of the classes.
        rule: by which they will count.
    """
    things = thing_classes(classes)
    sides = []
    for labels, numbers in (truth, prediction):
        is_thing = np.isin(labels, things)
        code = labels.astype(np.int64) << NUMBER | np.where(is_thing, numbers, 0)
        if rule == "coco":
            code[is_thing & (numbers == 0)] = VOID
            _, owners, pixels = np.unique(code, return_inverse=True, return_counts=True)
            code[pixels[owners].reshape(code.shape) < LEAST * code.size] = VOID
        else:
            code = code[MARGIN:-MARGIN, MARGIN:-MARGIN]
        sides.append(code)
    true, found = sides
    counted = (true < VOID) | (rule == "coco")
    pairs, pixels = np.unique(true[counted] << 2 * NUMBER | found[counted], return_counts=True)
    first, second = pairs >> 2 * NUMBER, pairs & ((1 << 2 * NUMBER) - 1)
    columns = [part for code in (first, second) for part in (code >> NUMBER, code & ((1 << NUMBER) - 1))]
    pairs = np.column_stack((*columns, pixels))
    return Segments(rule, len(classes), things, pairs)


def joined(parts: Sequence[Segments]) -> Segments:
    """The segments of several targets as those of one: things with the same number are one thing."""
    return replace(parts[0], pairs=np.concatenate([one.pairs for one in parts]))


@dataclass(frozen=True, eq=False)
class Tally:
    """What panoptic quality is computed from; sums of several add up.

    Attributes:
        counts: of each class: sum of the IoU of matches, matches, wrong segments, missed segments.
        occurs: whether truth or prediction shows each class.
        best: sum of the highest IoU of each true thing with a predicted one of its class, and the number of true things.
    """

    counts: Float64[np.ndarray, "class 4"]
    occurs: Bool[np.ndarray, " class"]
    best: Float64[np.ndarray, " 2"]


def tally(segments: Segments) -> Tally:
    """Match the segments of a target, or, with the rule "eps3d", of a group."""
    pairs, classes, as_eps3d = segments.pairs.copy(), segments.classes, segments.rule == "eps3d"
    if as_eps3d:
        shares = np.stack([np.bincount(pairs[:, side], pairs[:, 4], IGNORE + 1) for side in (0, 2)])
        rare = np.flatnonzero(((shares > 0) & (shares < RARE * pairs[:, 4].sum())).any(0))
        for side in (0, 2):
            pairs[np.isin(pairs[:, side], rare), side : side + 2] = (IGNORE, 0)
    (true, true_of), (found, found_of) = (
        np.unique(pairs[:, side : side + 2], axis=0, return_inverse=True) for side in (0, 2)
    )
    shared = np.zeros((len(true), len(found)))
    np.add.at(shared, (true_of.reshape(-1), found_of.reshape(-1)), pairs[:, 4])
    void, nothing = true[:, 0] == IGNORE, found[:, 0] == IGNORE
    on_void = shared[void].sum(0)
    not_said = shared[:, nothing].sum(1) * as_eps3d
    sizes, areas = shared.sum(1), shared.sum(0)
    union = (sizes - not_said)[:, None] + (areas - on_void) - shared
    iou = np.where((true[:, :1] == found[:, 0]) & ~void[:, None], shared / np.maximum(union, 1), 0.0)
    matched = iou > 0.5
    missed = ~void & ~matched.any(1) & ~(2 * not_said > sizes)
    wrong = ~nothing & ~matched.any(0) & ~(2 * on_void > areas)
    counts = np.zeros((classes, 4))
    rows, columns = np.nonzero(matched)
    np.add.at(counts, (true[rows, 0], 0), iou[rows, columns])
    for column, those in ((1, true[rows, 0]), (2, found[wrong, 0]), (3, true[missed, 0])):
        counts[:, column] = np.bincount(those, minlength=classes)
    is_thing = ~void & np.isin(true[:, 0], segments.things)
    occurs = np.isin(np.arange(classes), (*true[:, 0], *found[:, 0]))
    return Tally(counts, occurs, np.array([iou[is_thing].max(1, initial=0).sum(), is_thing.sum()]))


def qualities(
    counts: Float64[np.ndarray, "*trial class 4"], occurs: Bool[np.ndarray, " class"] | None = None
) -> Float64[np.ndarray, "*trial 3"]:
    """PQ, SQ and RQ: means over the classes that occur, by default those with a segment that is right, wrong or missed."""
    overlap, right, wrong, missed = np.moveaxis(counts, -1, 0)
    mean = right + (wrong + missed) / 2
    occurs = mean > 0 if occurs is None else occurs
    each = (overlap / np.maximum(mean, 0.5), overlap / np.maximum(right, 1e-9), right / np.maximum(mean, 0.5))
    number = np.maximum(occurs.sum(-1), 1)
    return np.stack([np.where(occurs, one, 0).sum(-1) / number for one in each], -1)


def true_boxes(
    contexts: Sequence[tuple[Views, Integer[np.ndarray, "h w"] | None]],
    classes: ClassTable,
    level_from_world: Float64[np.ndarray, "3 3"],
) -> list[tuple[int, Box]] | None:
    """Class and box of each thing that input views show on `LEAST` of their pixels or more; None if one lacks true classes, things or depth.

    Args:
        contexts: each view, and the number of the thing at each of its pixels.
        classes: the table of their classes.
        level_from_world: to the frame of the boxes.
    """
    points, owners = [np.zeros((0, 3))], [np.zeros((0, 2), np.int64)]
    pixels = 0
    for view, numbers in contexts:
        if view.labels is None or view.depths is None or numbers is None:
            return None
        labels = view.labels[0].numpy()
        kept = (numbers > 0) & np.isin(labels, thing_classes(classes)) & (view.depths[0].numpy() > 0)
        points.append(back_project(view.depths.double(), view.cameras)[0].numpy()[kept] @ level_from_world.T)
        owners.append(np.stack((labels[kept], numbers[kept]), -1).astype(np.int64))
        pixels += kept.size
    every, (names, of, counts) = (
        np.concatenate(points),
        np.unique(np.concatenate(owners), axis=0, return_inverse=True, return_counts=True),
    )
    large = np.flatnonzero(counts >= LEAST * pixels)
    return [(int(names[number, 0]), box_of(every[of.reshape(-1) == number])) for number in large]


def count_boxes(truth: Sequence[tuple[int, Box]], found: Sequence[tuple[int, Box]]) -> tuple[int, ...]:
    """The number of true boxes, of found ones, and of pairs of one class with at least each IoU of `OVERLAPS`: one to one, the best first.

    Args:
        truth, found: class and box of each thing.
    """
    pairs = [
        (one.thickened(THINNEST).iou(other.thickened(THINNEST)), mine, theirs)
        for mine, (label, one) in enumerate(truth)
        for theirs, (name, other) in enumerate(found)
        if label == name
    ]
    hits = []
    for least in OVERLAPS:
        kept: dict[int, int] = {}
        for overlap, mine, theirs in sorted(pairs, key=lambda pair: -pair[0]):
            if overlap >= least and mine not in kept and theirs not in kept.values():
                kept[mine] = theirs
        hits.append(len(kept))
    return len(truth), len(found), *hits
