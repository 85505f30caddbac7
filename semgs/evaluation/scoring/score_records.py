"""Scores of single targets as JSON and back; a report stores them for paired comparisons."""

from __future__ import annotations

import math
from dataclasses import asdict
from typing import Any, get_args

import numpy as np
import torch
from jaxtyping import Int64

from semgs.data.tables.classes import IGNORE
from semgs.evaluation.frames.free_space import FreeSpace
from semgs.evaluation.scoring.frame_scores import FrameScores
from semgs.evaluation.scoring.panoptic import Rule, Segments
from semgs.evaluation.scoring.summary import MORE_METRICS
from semgs.files.records import make_record
from semgs.objectives.metrics import DepthScores, accuracy, class_accuracy, miou
from semgs.objectives.selective import LEVELS


def finite(value: float | None) -> float | None:
    """A number, or None if JSON cannot express it."""
    return None if value is None or not math.isfinite(value) else value


def encode_scores(frame: FrameScores) -> dict[str, Any]:
    """The scores of a target, ready for JSON.

    `confusion` lists "true predicted pixels" of each pair that occurs; `truth` likewise "class pixels"; `confidences` "level 0 pixels" and "level 1 pixels
    that are right"; `segments` "true class, true thing, predicted class, predicted thing, pixels" of each pair.
    """
    found: dict[str, Any] = {"scene": frame.scene, "target": frame.target, "contexts": list(frame.contexts)}
    if frame.confusion is not None and frame.truth is not None:
        matrix, shown = torch.from_numpy(frame.confusion), torch.from_numpy(frame.truth > 0)
        found |= {
            "miou": float(miou(matrix, shown)),
            "accuracy": float(accuracy(matrix)),
            "class_accuracy": float(class_accuracy(matrix, shown)),
        }
    found |= {"psnr": finite(frame.psnr), "ssim": frame.ssim, "lpips": frame.lpips}
    if frame.depth is not None:
        found |= {
            "depth_abs_rel": frame.depth.abs_rel,
            "depth_delta_125": frame.depth.delta,
            "depth_pixels": frame.depth.pixels,
        }
    found["unseen"] = frame.unseen
    found |= {"miou_seen": frame.miou_seen, "accuracy_seen": frame.accuracy_seen, "psnr_seen": finite(frame.psnr_seen)}
    if frame.depth_seen is not None:
        found["depth_seen"] = asdict(frame.depth_seen)
    found |= {name: finite(value) for name, value in frame.more.items()}
    found["seconds_encode"] = seconds(frame.seconds_encode)
    found["seconds_render"] = seconds(frame.seconds_render)
    if frame.confusion is not None and frame.truth is not None:
        found["confusion"] = _sparse(frame.confusion)
        found["truth"] = _sparse(frame.truth)
    if frame.confidences is not None:
        found["confidences"] = _sparse(frame.confidences)
    if frame.segments is not None:
        found["segments"] = {
            "rule": frame.segments.rule,
            "things": list(frame.segments.things),
            "pairs": ", ".join(" ".join(map(str, row)) for row in frame.segments.pairs.tolist()),
        }
    if frame.free_space is not None:
        found["free_space"] = asdict(frame.free_space)
    if frame.boxes is not None:
        found["boxes"] = list(frame.boxes)
    return found


def seconds(value: float | None) -> float | None:
    """A time, rounded to a tenth of a millisecond."""
    return None if value is None else round(value, 4)


def decode_scores(entry: dict[str, Any], classes: int) -> FrameScores:
    """The scores of a target from JSON.

    Args:
        entry: made by `encode_scores`.
        classes: the number of classes.

    Raises:
        KeyError, TypeError, ValueError: it was not made by `encode_scores`.
    """
    shapes = {"confusion": (classes, classes), "truth": (classes,), "confidences": (LEVELS, 2)}
    values: dict[str, Any] = {name: _dense(entry[name], shape) for name, shape in shapes.items() if name in entry}
    for name in ("psnr", "ssim", "lpips", "unseen", "seconds_encode", "seconds_render"):
        values[name] = number(entry[name])
    for name in ("miou_seen", "accuracy_seen", "psnr_seen"):
        values[name] = number(entry.get(name))
    return FrameScores(
        scene=str(entry["scene"]),
        target=str(entry["target"]),
        contexts=tuple(entry["contexts"]),
        depth=_depth(entry, "depth_abs_rel", "depth_delta_125", "depth_pixels"),
        more={name: value for name in MORE_METRICS if (value := number(entry.get(name))) is not None},
        segments=_segments(entry["segments"], classes) if "segments" in entry else None,
        free_space=make_record(FreeSpace, entry["free_space"]) if "free_space" in entry else None,
        boxes=_boxes(entry["boxes"]) if "boxes" in entry else None,
        depth_seen=_depth(entry.get("depth_seen") or {}, "abs_rel", "delta", "pixels"),
        **values,
    )


def _depth(entry: dict[str, Any], error: str, delta: str, pixels: str) -> DepthScores | None:
    """The depth scores under three keys; None if there are none."""
    if entry.get(error) is None:
        return None
    return DepthScores(float(entry[error]), float(entry[delta]), int(entry[pixels]))


def _segments(entry: dict[str, Any], classes: int) -> Segments:
    """Segments from JSON."""
    if entry["rule"] not in get_args(Rule):
        raise ValueError(f"{entry['rule']!r:.40} is no rule of panoptic quality")
    pairs = np.array([row.split() for row in entry["pairs"].split(", ")], np.int64)
    known = (pairs[:, :4:2] < classes) | (pairs[:, :4:2] == IGNORE)
    if pairs.shape[1:] != (5,) or not known.all() or (pairs < 0).any():
        raise ValueError("segments are no rows of two classes, each with a thing, and pixels")
    return Segments(entry["rule"], classes, tuple(map(int, entry["things"])), pairs)


def _boxes(entry: list[Any]) -> tuple[int, ...]:
    """Numbers of boxes from JSON."""
    if len(entry) != 4 or not all(type(one) is int and one >= 0 for one in entry):
        raise ValueError(f"{entry!r:.40} are no numbers of boxes")
    return tuple(entry)


def number(value: object) -> float | None:
    """A number or None.

    Raises:
        TypeError: it is neither.
    """
    if value is None:
        return None
    if isinstance(value, int | float) and not isinstance(value, bool):
        return float(value)
    raise TypeError(f"{value!r:.40} is not a number")


def _sparse(counts: Int64[np.ndarray, " ..."]) -> str:
    """The non-zero entries, each as indices and count."""
    return ", ".join(" ".join(map(str, (*place, counts[tuple(place)]))) for place in np.argwhere(counts).tolist())


def _dense(text: str, shape: tuple[int, ...]) -> Int64[np.ndarray, " ..."]:
    """The array of a shape with these entries; ValueError or IndexError if an entry is invalid."""
    counts = np.zeros(shape, np.int64)
    for entry in text.split(", ") if text else ():
        *place, count = map(int, entry.split())
        if len(place) != len(shape) or min(*place, count) < 0:
            raise ValueError(f"{entry!r} is not an index and count for shape {shape}")
        counts[tuple(place)] = count
    return counts
