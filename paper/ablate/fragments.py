"""Fragments: how much of a class map is in tiny regions, which a segmentation without noise would not have."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np
from jaxtyping import UInt8
from scipy import ndimage

from semgs.evaluation.scoring.frame_scores import FrameScores
from semgs.evaluation.scoring.method_scores import PREDICTIONS
from semgs.files.images.pictures import read_uint8

SMALL = 0.0005
"""Regions of less than this share of the image are fragments; 38 pixels of 240x320."""


def fragments(labels: UInt8[np.ndarray, "h w"]) -> float:
    """The share of pixels in fragments: connected regions of one class, sides touching, of less than `SMALL` of the image."""
    limit, tiny = SMALL * labels.size, 0
    for label in np.unique(labels):
        regions, _ = ndimage.label(labels == label)
        sizes = np.bincount(regions.ravel())[1:]
        tiny += int(sizes[sizes < limit].sum())
    return tiny / labels.size


def with_fragments(frames: Sequence[FrameScores], evaluation: Path) -> list[FrameScores]:
    """The scores with the fragments of the class maps that an evaluation saved.

    Args:
        frames: its scores.
        evaluation: its folder.

    Raises:
        InputError: a class map is missing or damaged.
    """
    return [replace(frame, fragments=fragments(read_uint8(_map(evaluation, frame)))) for frame in frames]


def _map(evaluation: Path, frame: FrameScores) -> Path:
    """The class map of a target."""
    return evaluation / PREDICTIONS / f"N{len(frame.contexts)}" / frame.scene / f"{Path(frame.target).stem}.png"
