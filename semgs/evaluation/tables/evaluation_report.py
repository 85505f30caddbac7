"""report.json of an evaluation; `semgs.evaluation.tables.saved_report` reads it."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass
from statistics import median
from typing import Any

from semgs.data.tables.class_groups import ClassGroups
from semgs.data.tables.classes import ClassTable
from semgs.evaluation.frames.frame_plan import FramePlan, frame_list
from semgs.evaluation.frames.protocols import kind_aside
from semgs.evaluation.scoring.frame_scores import FrameScores
from semgs.evaluation.scoring.intervals import choose_units, intervals, risk_coverage
from semgs.evaluation.scoring.method_scores import MethodScores
from semgs.evaluation.scoring.score_records import encode_scores, finite, seconds
from semgs.evaluation.scoring.summary import (
    LOWER_IS_BETTER,
    METRICS,
    SEEN_METRICS,
    score_classes,
    summarise,
)

FORMAT = "semgs.report.evaluate"
SINGLE_FORMAT = "semgs.report.single"
"""Of reports of single images."""

VERSION = 1
"""Of both."""

COMPARED = tuple(name for name in METRICS if name not in ("unseen", "not_given", *SEEN_METRICS))
"""Metrics that rank methods."""


@dataclass(frozen=True)
class EvaluatedMethod:
    """What was evaluated.

    Attributes:
        name: in tables.
        kind: "weights", "predictions", or "segmenter" for one that classifies single images.
        source: where it comes from, in a sentence.
        sha256: of the weights; None for predictions, and where it is unknown.
        parameters: of our network; None for others.
    """

    name: str
    kind: str
    source: str
    sha256: str | None = None
    parameters: int | None = None


@dataclass(frozen=True, eq=False)
class Evaluation:
    """A finished evaluation: everything in its report.

    Attributes:
        subject: what was evaluated.
        data: the path of the scenes.
        plan: the targets.
        rows: the scores, by number of views.
        classes: the class table of the labels; None if no scene has labels.
        versions, hardware: of the software and the machine.
        notes: for the user, a sentence each.
        groups: of classes, of which metrics are added; None for none.
    """

    subject: EvaluatedMethod
    data: str
    plan: FramePlan
    rows: tuple[MethodScores, ...]
    classes: ClassTable | None
    versions: Mapping[str, str]
    hardware: Mapping[str, str | int]
    notes: tuple[str, ...]
    groups: ClassGroups | None = None


def evaluation_numbers(evaluation: Evaluation) -> dict[str, Any]:
    """All numbers of the report, ready for JSON; unknown values are None.

    Depth errors are ratios, so they have no unit. `psnr` is in dB, and None for equal images.
    """
    scenes = evaluation.plan.scenes
    return {
        "format": FORMAT,
        "version": VERSION,
        "method": asdict(evaluation.subject),
        "data": {
            "path": evaluation.data,
            "scenes": [
                {
                    "name": scene.name,
                    "layout": scene.layout,
                    "unit": scene.unit,
                    "usable_frames": len(scene),
                    "absent_frames": list(scene.absent),
                }
                for scene in scenes
            ],
        },
        "protocol": evaluation.plan.title,
        "classes": evaluation.classes and {"name": evaluation.classes.name, "names": list(evaluation.classes.names)},
        "merge": evaluation.groups and asdict(evaluation.groups),
        "results": [_result(rows, evaluation.classes) for rows in evaluation.rows],
        "notes": list(evaluation.notes),
        "versions": dict(evaluation.versions),
        "hardware": dict(evaluation.hardware),
        "frames": frame_list(evaluation.plan),
    }


def _result(rows: MethodScores, classes: ClassTable | None) -> dict[str, Any]:
    """The entry for one number of views."""
    numbers = _numbers(rows.method)
    trivial = {name: _numbers(frames) for name, frames in rows.baselines.items()}
    if classes is not None:
        for name, frames in rows.baselines.items():
            scored = zip(classes.names, score_classes(frames), strict=False)
            trivial[name]["per_class_iou"] = {label: one.iou for label, one in scored if one.iou is not None}
    scenes = dict.fromkeys(frame.scene for frame in rows.method)
    entry = {
        "views": rows.views,
        **numbers,
        "samples": len(rows.method),
        **timing(rows.method),
        "below_copy": worse_than_copy(numbers, trivial["copy"]),
        "trivial": trivial,
        "per_class": [],
        "risk_coverage": [asdict(point) for point in risk_coverage(rows.method)],
        "per_scene": [
            {"scene": scene, **_metrics(these), "samples": len(these)}
            for scene in scenes
            for these in [[frame for frame in rows.method if frame.scene == scene]]
        ],
        "kinds": [
            {"kind": kind, **_numbers(these), "samples": len(these)}
            for kind in dict.fromkeys(kind_aside(frame.target) for frame in rows.method)
            if kind
            for these in [[frame for frame in rows.method if kind_aside(frame.target) == kind]]
        ],
        "truth_sha256": rows.truth,
        "per_frame": [encode_scores(frame) for frame in rows.method],
    }
    if classes is not None:
        scores = score_classes(rows.method)
        entry["per_class"] = [{"name": name, **asdict(one)} for name, one in zip(classes.names, scores, strict=False)]
    return entry


def timing(frames: Sequence[FrameScores]) -> dict[str, float | None]:
    """Median seconds over targets (the first ones compile), and two kinds of frames per second.

    `fps_encoding_each` encodes anew for each target, as ray-marching methods must. `fps_encoding_shared` renders many targets
    from one encoding, so it counts rendering only.
    """
    encode, render = (
        median(known) if (known := [value for value in times if value is not None]) else None
        for times in ([frame.seconds_encode for frame in frames], [frame.seconds_render for frame in frames])
    )
    both = None if encode is None or render is None else encode + render
    return {
        "seconds_encode": seconds(encode),
        "seconds_render": seconds(render),
        "fps_encoding_each": round(1 / both, 4) if both else None,
        "fps_encoding_shared": round(1 / render, 4) if render else None,
    }


def worse_than_copy(numbers: Mapping[str, Any], copy: Mapping[str, Any]) -> list[str]:
    """The metrics that are worse than those of the oracle that copies the nearest input view."""
    worse = []
    for name in COMPARED:
        ours, theirs = numbers.get(name), copy.get(name)
        if ours is not None and theirs is not None and (ours > theirs if name in LOWER_IS_BETTER else ours < theirs):
            worse.append(name)
    return worse


def _numbers(frames: Sequence[FrameScores]) -> dict[str, Any]:
    """The metrics of some targets, with their intervals."""
    found = intervals(frames)
    return {
        **_metrics(frames),
        "intervals": {name: [finite(found[name].low), finite(found[name].high)] for name in METRICS if name in found},
        "intervals_over": choose_units(frames),
    }


def _metrics(frames: Sequence[FrameScores]) -> dict[str, float | None]:
    """All metrics; None if unknown."""
    values = summarise(frames)
    return {name: finite(values.get(name)) for name in METRICS}
