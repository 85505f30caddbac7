"""Summaries: the metrics of a table, from the scores of any set of targets.

| name | what |
|---|---|
| miou, class_accuracy, accuracy | from one confusion matrix over all targets |
| miou_per_image, class_accuracy_per_image, accuracy_per_image | for each target; mean over targets, then over scenes |
| psnr, ssim, lpips | for each target; mean over targets |
| depth_abs_rel, depth_delta_125 | over all pixels of all targets that have a true depth |
| miou_per_image_seen, accuracy_per_image_seen, psnr_seen, depth_abs_rel_seen | the same over the seen pixels |
| miou_merged, accuracy_merged | as miou and accuracy, of groups of classes |
| aurc, ece, covered_95 | over the labelled and seen pixels of all targets: `semgs.objectives.selective` |
| unseen | share of all pixels |
| psnr_edges, depth_edges, psnr_gradients, made_up, flyers | of targets aside: `semgs.evaluation.scoring.frame_scores`; mean over targets |
| changed_classes, changed_depth | of targets that are predicted from two sets of input views; mean over targets |
| pq, sq, rq, instance_miou | of classes and things: `semgs.evaluation.scoring.panoptic` |
| box_recall_25, box_precision_25, box_recall_50, box_precision_50 | share of the true boxes that are found, and of the found ones that are true |
| obstacles_free, free_found, obstacle_error | of maps of free space: `semgs.evaluation.frames.free_space` |
| not_given | share of the labelled pixels without a predicted class |

Means over classes use the classes that occur in the truth, of the whole set or of the image.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import astuple, dataclass
from functools import partial
from typing import Any

import numpy as np
import torch
from jaxtyping import Float, Int, Int64

from semgs.evaluation.scoring.frame_scores import FrameScores
from semgs.evaluation.scoring.panoptic import joined, qualities, tally
from semgs.objectives.measures import TITLES
from semgs.objectives.metrics import accuracy, class_accuracy, intersection_over_union, miou
from semgs.objectives.selective import area_under_risk_coverage, coverage_at_risk, equal_mass_calibration_error

CLASS_METRICS = (
    "miou", "miou_per_image", "accuracy", "accuracy_per_image", "class_accuracy", "class_accuracy_per_image", "not_given",
)  # fmt: skip
PICTURE_METRICS = ("psnr", "ssim", "lpips")
DEPTH_METRICS = ("depth_abs_rel", "depth_delta_125")
SEEN_METRICS = ("miou_per_image_seen", "accuracy_per_image_seen", "psnr_seen", "depth_abs_rel_seen")
"""Metrics over the pixels that a method saw. Methods see different pixels, so these do not rank methods."""

CONFIDENCE_METRICS = ("aurc", "ece", "covered_95")

MERGED_METRICS = ("miou_merged", "accuracy_merged")
"""Metrics of groups of classes (`semgs.data.tables.class_groups`)."""

ASIDE_METRICS = ("psnr_edges", "depth_edges", "psnr_gradients", "made_up", "flyers")
"""Metrics of targets aside (`semgs.evaluation.scoring.frame_scores`)."""

PAIR_METRICS = ("changed_classes", "changed_depth")
"""Metrics of targets that are predicted from two sets of input views (`semgs.evaluation.scoring.frame_scores.changes`)."""

MORE_METRICS = (*ASIDE_METRICS, *PAIR_METRICS)
"""Both."""

PANOPTIC_METRICS = ("pq", "sq", "rq", "instance_miou")
BOX_METRICS = ("box_recall_25", "box_precision_25", "box_recall_50", "box_precision_50")
"""Metrics of things (`semgs.evaluation.scoring.panoptic`)."""

FREE_SPACE_METRICS = ("obstacles_free", "free_found", "obstacle_error")
"""Metrics of maps of free space (`semgs.evaluation.frames.free_space`)."""

THINGS_METRICS = (*PANOPTIC_METRICS, *BOX_METRICS, *FREE_SPACE_METRICS)
"""What a robot acts on."""

ON_REQUEST = (*MERGED_METRICS, *MORE_METRICS, *THINGS_METRICS)
"""Metrics that reports have only if they were requested."""

RISK = 0.05
"""The share of wrong pixels up to which `covered_95` counts."""

METRICS = tuple(name for name in TITLES if name != "fps_encoding_each")
"""All names, in the order of tables."""

LOWER_IS_BETTER = (
    "lpips",
    "depth_abs_rel",
    "depth_abs_rel_seen",
    "unseen",
    "not_given",
    "aurc",
    "ece",
    "depth_edges",
    "made_up",
    "flyers",
    "changed_classes",
    "changed_depth",
    "obstacles_free",
    "obstacle_error",
)


Values = Callable[[Int[np.ndarray, "trial n"], Int[np.ndarray, "trial scene"]], Float[np.ndarray, "metric trial"]]
"""Computes metrics from how often each target and each scene counts."""


@dataclass(frozen=True, eq=False)
class MetricGroup:
    """Metrics of the same targets, as a function of how often each target counts.

    Attributes:
        names: of the metrics.
        scene_of: the number of each target's scene, 0, 1, ... .
        values: computes the metrics [metric trial] from how often each target and each scene counts. In means over scenes,
            scene counts weigh the scenes, and target counts only weigh the targets within a scene.
    """

    names: tuple[str, ...]
    scene_of: Int64[np.ndarray, " n"]
    values: Values

    def once(self) -> dict[str, float]:
        """The metrics with every target and scene counted once."""
        scenes = int(self.scene_of.max()) + 1
        values = self.values(np.ones((1, len(self.scene_of)), np.int64), np.ones((1, scenes), np.int64))
        return dict(zip(self.names, values[:, 0].tolist(), strict=True))


def group_metrics(frames: Sequence[FrameScores]) -> list[MetricGroup]:
    """The metrics of some targets, in groups. Each group uses the targets that have what it needs."""
    groups: tuple[tuple[tuple[str, ...], str, Callable[..., Values]], ...] = (
        (CLASS_METRICS, "confusion", _class_values),
        (MERGED_METRICS, "merged", _merged_values),
        *(
            ((name,), name, partial(_means, name))
            for name in (*PICTURE_METRICS, "psnr_seen", "unseen", "fragments", *MORE_METRICS)
        ),
        *(
            ((f"{name}_per_image_seen",), f"{name}_seen", partial(_means_over_scenes, f"{name}_seen"))
            for name in ("miou", "accuracy")
        ),
        (PANOPTIC_METRICS, "segments", _panoptic_values),
        (BOX_METRICS, "boxes", _box_values),
        (FREE_SPACE_METRICS, "free_space", _free_space_values),
        (DEPTH_METRICS, "depth", partial(_depth_values, "depth", ("abs_rel", "delta"))),
        (("depth_abs_rel_seen",), "depth_seen", partial(_depth_values, "depth_seen", ("abs_rel",))),
    )
    found = []
    for names, needed, values in groups:
        scored = [frame for frame in frames if _score(frame, needed) is not None]
        if scored:
            scene_of = _scene_numbers(scored)
            found.append(MetricGroup(names, scene_of, values(scored, scene_of)))
    if any(frame.confidences is not None and frame.confidences.any() for frame in frames):
        found.append(
            group_confidences(
                frames,
                CONFIDENCE_METRICS,
                lambda counts: np.stack(
                    [
                        area_under_risk_coverage(counts),
                        equal_mass_calibration_error(counts),
                        coverage_at_risk(counts, RISK),
                    ],
                    -1,
                ),
            )
        )
    return found


def group_confidences(
    frames: Sequence[FrameScores], names: tuple[str, ...], metrics: Callable[[np.ndarray], np.ndarray]
) -> MetricGroup:
    """Metrics of the confidence at the labelled and seen pixels of all targets together.

    Args:
        frames: some of which have such pixels; the others are left out.
        names: of the metrics.
        metrics: computes them [trial metric] from counts [trial level 2].
    """
    scored = [frame for frame in frames if frame.confidences is not None and frame.confidences.any()]
    counts = np.stack([frame.confidences for frame in scored if frame.confidences is not None])
    flat = counts.reshape(len(scored), -1).astype(np.float64)  # exact up to 2^53 pixels, and fast to multiply

    def values(times: np.ndarray, scene_times: np.ndarray) -> np.ndarray:
        return metrics((times @ flat).astype(np.int64).reshape(-1, *counts.shape[1:])).T

    return MetricGroup(names, _scene_numbers(scored), values)


def _scene_numbers(frames: Sequence[FrameScores]) -> Int64[np.ndarray, " n"]:
    """The number of each target's scene, 0, 1, ... ."""
    order = {scene: number for number, scene in enumerate(dict.fromkeys(frame.scene for frame in frames))}
    return np.array([order[frame.scene] for frame in frames], np.int64)


def summarise(frames: Sequence[FrameScores]) -> dict[str, float]:
    """The metrics that some targets have, in the order of `METRICS`."""
    values: dict[str, float] = {}
    for group in group_metrics(frames):
        values |= group.once()
    return {name: values[name] for name in METRICS if name in values}


def find_extremes(frames: Sequence[FrameScores], most: int) -> tuple[list[int], list[int]]:
    """Positions of the best and of the worst frames, up to `most` of each without overlap, best and worst first.

    Ranked by mean IoU, or by PSNR if no classes are scored. Frames without that score are left out.
    """
    metric = "psnr" if all(frame.confusion is None for frame in frames) else "miou_per_image"
    values = [summarise([frame]).get(metric, math.nan) for frame in frames]
    order = sorted((i for i, value in enumerate(values) if math.isfinite(value)), key=lambda i: -values[i])
    best = order[: min(most, (len(order) + 1) // 2)]
    return best, order[len(best) :][::-1][:most]


@dataclass(frozen=True)
class ClassScores:
    """One class over all targets.

    Attributes:
        iou, accuracy: intersection over union, and share of its true pixels that are correct; None if it does not occur.
        pixels: number with this true class.
        predicted: number of pixels predicted as this class.
    """

    iou: float | None
    accuracy: float | None
    pixels: int
    predicted: int


def score_classes(frames: Sequence[FrameScores]) -> list[ClassScores]:
    """The scores of each class, in the order of the class table; empty if no target has labels."""
    confusion, truth = sum_confusions(frames)
    ious = intersection_over_union(torch.from_numpy(confusion)).tolist()
    hits, rows = confusion.diagonal(), confusion.sum(1)
    return [
        ClassScores(
            iou=ious[label] if truth[label] else None,
            accuracy=float(hits[label] / max(rows[label], 1)) if truth[label] else None,
            pixels=int(truth[label]),
            predicted=int(confusion[:, label].sum()),
        )
        for label in range(len(truth))
    ]


def sum_confusions(
    frames: Sequence[FrameScores],
) -> tuple[Int64[np.ndarray, "class class"], Int64[np.ndarray, " class"]]:
    """The confusion matrix of all targets, and their pixels by true class; both empty if no target has labels."""
    pairs = [
        (frame.confusion, frame.truth) for frame in frames if frame.confusion is not None and frame.truth is not None
    ]
    if not pairs:
        return np.zeros((0, 0), np.int64), np.zeros(0, np.int64)
    return np.sum([confusion for confusion, _ in pairs], axis=0), np.sum([truth for _, truth in pairs], axis=0)


def _class_values(frames: Sequence[FrameScores], scene_of: np.ndarray) -> Values:
    """Computes `CLASS_METRICS`."""
    confusions = np.stack([frame.confusion for frame in frames if frame.confusion is not None])
    truths = np.stack([frame.truth for frame in frames if frame.truth is not None])
    classes = truths.shape[1]
    flat = confusions.reshape(len(frames), -1).astype(np.float64)  # exact up to 2^53 pixels, and fast to multiply
    each, shown = torch.from_numpy(confusions), torch.from_numpy(truths > 0)
    per_image = [score.numpy() for score in (miou(each, shown), accuracy(each), class_accuracy(each, shown))]

    def values(times: np.ndarray, scene_times: np.ndarray) -> np.ndarray:
        summed = (times @ flat).astype(np.int64).reshape(-1, classes, classes)
        truth = times @ truths
        total, present = torch.from_numpy(summed), torch.from_numpy(truth > 0)
        overall = [score.numpy() for score in (miou(total, present), accuracy(total), class_accuracy(total, present))]
        images = [_scene_means(values, scene_of, times, scene_times) for values in per_image]
        pairs = [column for pair in zip(overall, images, strict=True) for column in pair]
        return np.stack([*pairs, 1 - _ratio(summed.sum((1, 2)), truth.sum(1))])

    return values


def _merged_values(frames: Sequence[FrameScores], scene_of: np.ndarray) -> Values:
    """Computes `MERGED_METRICS`."""
    confusions = np.stack([frame.merged for frame in frames if frame.merged is not None])
    truths = np.stack([frame.merged_truth for frame in frames if frame.merged_truth is not None])
    flat = confusions.reshape(len(frames), -1).astype(np.float64)

    def values(times: np.ndarray, scene_times: np.ndarray) -> np.ndarray:
        total = torch.from_numpy((times @ flat).astype(np.int64).reshape(-1, *confusions.shape[1:]))
        return np.stack([miou(total, torch.from_numpy(times @ truths > 0)).numpy(), accuracy(total).numpy()])

    return values


def _panoptic_values(frames: Sequence[FrameScores], scene_of: np.ndarray) -> Values:
    """Computes `PANOPTIC_METRICS`."""
    held = [frame.segments for frame in frames if frame.segments is not None]
    as_eps3d = held[0].rule == "eps3d"
    keys = [(frame.scene, frame.contexts) if as_eps3d else number for number, frame in enumerate(frames)]
    groups = list(dict.fromkeys(keys))
    share = np.array([[key == group for group in groups] for key in keys], np.float64)
    share /= share.sum(0)
    tallies = [tally(joined([held[number] for number in np.flatnonzero(column)])) for column in share.T]
    counts, best = np.stack([one.counts for one in tallies]), np.stack([one.best for one in tallies])
    each = np.stack([qualities(one.counts, one.occurs) for one in tallies])

    def values(times: np.ndarray, scene_times: np.ndarray) -> np.ndarray:
        weights = times @ share
        sums = weights @ best
        found = weights @ each / weights.sum(1)[:, None] if as_eps3d else qualities(np.tensordot(weights, counts, 1))
        return np.concatenate((found.T, _ratio(sums[:, 0], sums[:, 1])[None]))

    return values


def _box_values(frames: Sequence[FrameScores], scene_of: np.ndarray) -> Values:
    """Computes `BOX_METRICS`."""
    counts = np.array([frame.boxes for frame in frames], np.int64)

    def values(times: np.ndarray, scene_times: np.ndarray) -> np.ndarray:
        true, found, *hits = (times @ counts).T
        return np.stack([_ratio(hit, of) for hit in hits for of in (true, found)])

    return values


def _free_space_values(frames: Sequence[FrameScores], scene_of: np.ndarray) -> Values:
    """Computes `FREE_SPACE_METRICS`."""
    counts = np.array([astuple(frame.free_space) for frame in frames if frame.free_space is not None])

    def values(times: np.ndarray, scene_times: np.ndarray) -> np.ndarray:
        occupied, wrong, free, right, cameras, error = (times @ counts).T
        return np.stack([_ratio(wrong, occupied), _ratio(right, free), _ratio(error, cameras)])

    return values


def _score(frame: FrameScores, name: str) -> Any:
    """A score of a target by its name; None if it has none."""
    return frame.more.get(name) if name in MORE_METRICS else getattr(frame, name)


def _means(name: str, frames: Sequence[FrameScores], scene_of: np.ndarray) -> Values:
    """Computes the mean of a score over targets."""
    scores = np.array([_score(frame, name) for frame in frames], np.float64)
    return lambda times, scene_times: _weighted(scores, times)[None]


def _means_over_scenes(name: str, frames: Sequence[FrameScores], scene_of: np.ndarray) -> Values:
    """Computes the mean of a score over the targets of each scene, then over scenes."""
    scores = np.array([getattr(frame, name) for frame in frames], np.float64)
    return lambda times, scene_times: _scene_means(scores, scene_of, times, scene_times)[None]


def _depth_values(name: str, measures: Sequence[str], frames: Sequence[FrameScores], scene_of: np.ndarray) -> Values:
    """Computes the means of depth scores over all pixels with a true depth."""
    depths = [getattr(frame, name) for frame in frames]
    pixels = np.array([depth.pixels for depth in depths], np.int64)
    columns = [np.array([getattr(depth, measure) for depth in depths]) for measure in measures]
    return lambda times, scene_times: np.stack([_weighted(column, times * pixels) for column in columns])


def _weighted(values: np.ndarray, weights: np.ndarray) -> np.ndarray:
    """Weighted means [trial] of values [n] with weights [trial n]; an infinite value with a weight makes its mean infinite."""
    return _ratio(np.where(weights > 0, weights * np.where(weights > 0, values, 0), 0).sum(1), weights.sum(1))


def _scene_means(values: np.ndarray, scene_of: np.ndarray, times: np.ndarray, scene_times: np.ndarray) -> np.ndarray:
    """Means over the targets of each scene, then over scenes; scenes without counted targets are left out."""
    member = (scene_of[:, None] == np.arange(scene_times.shape[1])).astype(np.float64)
    counts = times @ member
    means = _ratio((times * values) @ member, counts)
    weights = scene_times * (counts > 0)
    return _ratio((means * weights).sum(1), weights.sum(1))


def _ratio(numerator: np.ndarray, denominator: np.ndarray) -> np.ndarray:
    """The quotient, 0 for 0 / 0."""
    return numerator / np.where(denominator == 0, 1, denominator)
