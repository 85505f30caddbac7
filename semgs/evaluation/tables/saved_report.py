"""Reads a report.json of `semgs evaluate`, of rendered views or of single images."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from hashlib import sha256
from pathlib import Path
from typing import Any

from semgs.data.tables.class_groups import ClassGroups
from semgs.evaluation.scoring.baselines import NAMES
from semgs.evaluation.scoring.frame_scores import FrameScores
from semgs.evaluation.scoring.intervals import intervals, units_of
from semgs.evaluation.scoring.score_records import decode_scores, finite, number
from semgs.evaluation.scoring.summary import (
    CONFIDENCE_METRICS,
    MERGED_METRICS,
    METRICS,
    ON_REQUEST,
    SEEN_METRICS,
    summarise,
)
from semgs.evaluation.tables.evaluation_report import FORMAT, SINGLE_FORMAT, VERSION
from semgs.files.errors import InputError
from semgs.files.strict_json import read_json
from semgs.files.text import counted

SINGLE = "single images"
"""The protocol of reports of single images."""


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

    @property
    def single(self) -> bool:
        """Whether each image was classified by itself."""
        return self.protocol == SINGLE

    def targets(self, count: int) -> str:
        """A number of targets, in words."""
        return (
            counted(count, "single image") if self.single else f"{counted(count, 'target')}, protocol {self.protocol}"
        )

    def amount(self, views: int) -> str:
        """How much was evaluated with a number of views, in words."""
        if self.single:
            return f"({counted(len(self.results[views].frames), 'image')})"
        return f"({counted(len(self.sizes), 'scene')}), {views} views"

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
    found = content.get("format") if isinstance(content, dict) else type(content).__name__
    kinds = {FORMAT: saved_report, SINGLE_FORMAT: saved_single_images}
    if (
        not isinstance(content, dict)
        or not isinstance(found, str)
        or found not in kinds
        or content.get("version") != VERSION
    ):
        raise InputError(path, f"a report of format {FORMAT}, version {VERSION}", f"{found!r:.60}", key="format")
    try:
        return kinds[found](path, content)
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
        sha256=_sha256(content["method"]),
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


def saved_single_images(path: Path, content: dict[str, Any]) -> SavedReport:
    """The report of single images with some content: as one of rendered views, with one view for each target and without what is not known of images.

    Args, Raises:
        As for `saved_report`; the content is made by `single_numbers`.
    """
    targets = content["per_image"]
    entry = {
        **dict.fromkeys(METRICS),
        **content,
        "views": 1,
        "samples": len(targets),
        "fps_encoding_each": None,
        "below_copy": [],
        "trivial": {},
        "intervals_over": units_of({one["scene"] for one in targets}),
        "truth_sha256": sha256("; ".join(str(one["truth"]) for one in targets).encode()).hexdigest(),
        "per_frame": targets,
    }
    data = {"path": ", ".join(str(one["name"]) for one in content["data"]), "scenes": content["data"]}
    shared: dict[str, Any] = {name: content[name] for name in ("method", "classes", "hardware") if name in content}
    return saved_report(
        path, {**shared, "protocol": SINGLE, "data": data, "frames": {"scenes": []}, "results": [entry]}
    )


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


def _sha256(method: Mapping[str, Any]) -> str | None:
    """The hash of a method's weights."""
    found = method.get("sha256")
    return None if found is None else str(found)


def data_name(path: str, scenes: Sequence[str]) -> str:
    """A short name for data: the scene if there is only one, else the last part of the path."""
    parts = [part for part in path.replace("\\", "/").split("/") if part not in ("", ".", "..")]
    return scenes[0] if len(scenes) == 1 or not parts else parts[-1]
