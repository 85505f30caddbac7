"""report.json of an evaluation: writing and reading it."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass, field, replace
from pathlib import Path
from statistics import median
from typing import Any

from semgs.data.tables.class_groups import ClassGroups
from semgs.data.tables.classes import ClassTable
from semgs.evaluation.frames.frame_plan import FramePlan, frame_list
from semgs.evaluation.frames.protocols import kind_aside
from semgs.evaluation.scoring.baselines import NAMES
from semgs.evaluation.scoring.frame_scores import FrameScores
from semgs.evaluation.scoring.intervals import choose_units, intervals, risk_coverage
from semgs.evaluation.scoring.method_scores import MethodScores
from semgs.evaluation.scoring.score_records import decode_scores, encode_scores, finite, number, seconds
from semgs.evaluation.scoring.summary import (
    CONFIDENCE_METRICS,
    LOWER_IS_BETTER,
    MERGED_METRICS,
    METRICS,
    ON_REQUEST,
    SEEN_METRICS,
    score_classes,
    summarise,
)
from semgs.files.errors import InputError
from semgs.files.strict_json import read_json

FORMAT = "semgs.report.evaluate"
VERSION = 1

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


@dataclass(frozen=True, eq=False)
class SavedResult:
    """The part of a `SavedReport` for one number of views.

    Attributes:
        views: the number of contexts.
        numbers: the entry in `results`.
        baselines: their numbers, by name.
        frames: the scores of each target.
        truth: the hash of the truth.
    """

    views: int
    numbers: Mapping[str, Any]
    baselines: Mapping[str, Mapping[str, Any]]
    frames: tuple[FrameScores, ...]
    truth: str

    def by_groups(self, groups: ClassGroups) -> SavedResult:
        """The same with metrics of groups of classes, of the method."""
        frames = tuple(frame.by_groups(groups) for frame in self.frames)
        found, ends = summarise(frames), intervals(frames)
        merged = {name: finite(found[name]) for name in MERGED_METRICS if name in found}
        bounds = {name: [ends[name].low, ends[name].high] for name in merged if name in ends}
        return replace(
            self, frames=frames, numbers={**self.numbers, **merged, "intervals": {**self.numbers.get("intervals", {}), **bounds}},
        )  # fmt: skip


@dataclass(frozen=True, eq=False)
class SavedReport:
    """A report read from its file.

    Attributes:
        path: of the file.
        name: of what was evaluated.
        protocol: in words.
        sizes: (height, width) of each scene [px].
        classes: the name of the class table; None without labels.
        results: by number of views.
        data_name: short name of the data: the scene, or the last part of the path.
        hardware: of the evaluation; empty in reports of older versions.
        sha256: of the weights file; None for predictions.
        class_names: of the table of the labels; empty without.
        groups: of classes, of which it has metrics; None for none.
    """

    path: Path
    name: str
    protocol: str
    sizes: Mapping[str, tuple[int, int]]
    classes: str | None
    results: Mapping[int, SavedResult]
    data_name: str = "data"
    hardware: Mapping[str, str | int] = field(default_factory=dict)
    sha256: str | None = None
    class_names: tuple[str, ...] = ()
    groups: ClassGroups | None = None

    def by_groups(self, groups: ClassGroups) -> SavedReport:
        """The same with metrics of groups of classes; of the method alone, as a report has no frames of baselines."""
        return replace(
            self, groups=groups, results={views: one.by_groups(groups) for views, one in self.results.items()}
        )


def read_report(path: str | Path) -> SavedReport:
    """Read a report.json of `semgs evaluate`.

    Raises:
        InputError: the file cannot be read, is no report, or has another version.
    """
    path = Path(path)
    if path.is_dir():
        path = path / "report.json"
    content = read_json(path, "the report.json of an evaluation")
    if not isinstance(content, dict) or (content.get("format"), content.get("version")) != (FORMAT, VERSION):
        found = content.get("format") if isinstance(content, dict) else type(content).__name__
        raise InputError(path, f"a report of format {FORMAT}, version {VERSION}", f"{found!r:.60}", key="format")
    try:
        return saved_report(path, content)
    except (LookupError, TypeError, ValueError, OverflowError, AttributeError) as error:
        raise InputError(path, "a complete report of semgs evaluate", f"{type(error).__name__}: {error}") from error


def saved_report(path: Path, content: dict[str, Any]) -> SavedReport:
    """The report with some content.

    Args:
        path: of its file, which need not exist yet.
        content: made by `evaluation_numbers`.

    Raises:
        LookupError, TypeError, ValueError, OverflowError, AttributeError: the content is no complete report.
    """
    classes = content["classes"]
    results = [_saved_result(entry, len(classes["names"]) if classes else 0) for entry in content["results"]]
    report = SavedReport(
        path=path,
        name=str(content["method"]["name"]),
        protocol=str(content["protocol"]),
        sizes={one["scene"]: (int(one["size"][0]), int(one["size"][1])) for one in content["frames"]["scenes"]},
        classes=classes["name"] if classes else None,
        results={result.views: result for result in results},
        data_name=data_name(str(content["data"]["path"]), [str(one["name"]) for one in content["data"]["scenes"]]),
        hardware=dict(content.get("hardware", {})),
        sha256=content["method"].get("sha256"),
        class_names=tuple(map(str, classes["names"])) if classes else (),
    )
    if not content.get("merge"):
        return report
    names, of = content["merge"]["names"], content["merge"]["of"]
    groups = ClassGroups(str(content["merge"]["name"]), tuple(map(int, of)), tuple(map(str, names)))
    if len(of) != len(report.class_names) or not all(0 <= one < len(names) for one in of):
        raise ValueError("its groups do not fit its classes")
    merged = {
        views: replace(one, frames=tuple(frame.by_groups(groups) for frame in one.frames))
        for views, one in report.results.items()
    }
    return replace(report, groups=groups, results=merged)


def _saved_result(entry: dict[str, Any], classes: int) -> SavedResult:
    """The entry for one number of views, after a check of all that tables show of it.

    Raises:
        LookupError, TypeError, ValueError, OverflowError, AttributeError: it is incomplete.
    """
    values = [entry["fps_encoding_each"]]
    for row in (entry, *entry["trivial"].values()):
        # Reports of older versions have neither metrics of the seen pixels nor of confidence.
        absent = (
            *SEEN_METRICS,
            *CONFIDENCE_METRICS,
            *ON_REQUEST,
        )
        values += [row.get(name) if name in absent else row[name] for name in METRICS]
        values += [end for low, high in row.get("intervals", {}).values() for end in (low, high)]
    values += [label[name] for label in entry["per_class"] for name in ("pixels", "iou")]
    points = entry.get("risk_coverage") or ()
    values += [point[name] for point in points for name in ("coverage", "risk", "low", "high", "confidence")]
    for value in values:
        number(value)
    names = [*entry["below_copy"], *(label["name"] for label in entry["per_class"])]
    if wrong := [name for name in names if not isinstance(name, str)]:
        raise TypeError(f"{wrong[0]!r:.40} is not a name")
    if entry["intervals_over"] not in ("scenes", "frames"):
        raise ValueError(f"intervals_over is {entry['intervals_over']!r}")
    return SavedResult(
        views=int(entry["views"]),
        numbers=entry,
        baselines={name: entry["trivial"][name] for name in NAMES if name in entry["trivial"]},
        frames=tuple(decode_scores(frame, classes) for frame in entry["per_frame"]),
        truth=str(entry["truth_sha256"]),
    )


def data_name(path: str, scenes: Sequence[str]) -> str:
    """A short name for data: the scene if there is only one, else the last part of the path."""
    parts = [part for part in path.replace("\\", "/").split("/") if part not in ("", ".", "..")]
    return scenes[0] if len(scenes) == 1 or not parts else parts[-1]
