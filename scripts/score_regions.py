"""How clean class maps are: speckle and accuracy at borders, next to mIoU and accuracy, in held-out views of rooms.

    python scripts/score_regions.py ROOMS WEIGHTS [WEIGHTS ...]

Frames 0 and 2 of each scene are the input views, 1 and 3 the targets. Speckle is the share of pixels in regions of less than 0.05 % of the image.
A pixel is at a border if a pixel of another true class lies within three steps.
"""

from __future__ import annotations

import sys

import numpy as np
import torch
from jaxtyping import Bool, UInt8
from scipy import ndimage

from semgs.data.scenes import open_scene, scene_paths
from semgs.data.tables.classes import IGNORE
from semgs.evaluation.scoring.fragments import fragments
from semgs.model.weights.load import load
from semgs.objectives.metrics import accuracy, confusion_matrix, miou

STEPS = 3
"""Pixels up to so many steps from another true class are at a border."""


def near_border(labels: UInt8[np.ndarray, "h w"]) -> Bool[np.ndarray, "h w"]:
    """Pixels near one of another class."""
    edge = np.zeros(labels.shape, bool)
    across, down = labels[:, 1:] != labels[:, :-1], labels[1:] != labels[:-1]
    edge[:, 1:] |= across
    edge[:, :-1] |= across
    edge[1:] |= down
    edge[:-1] |= down
    return ndimage.binary_dilation(edge, iterations=STEPS - 1)


def scores(weights: str, rooms: str) -> dict[str, float]:
    """Scores of one file of weights over all scenes."""
    model = load(weights).eval()
    confusion = torch.zeros(model.class_count, model.class_count, dtype=torch.int64)
    found: list[float] = []
    right, all_ = np.zeros(2), np.zeros(2)
    for path in scene_paths(rooms):
        views = open_scene(path).read([0, 2, 1, 3])
        with torch.inference_mode():
            rendering = model(views.select([0, 1])).render(views.select([2, 3]).cameras)
        labels, truth = rendering.semantics.argmax(-3).to(torch.uint8), views.labels[2:]
        confusion += confusion_matrix(labels, truth, model.class_count)
        for predicted, true in zip(labels.numpy(), truth.numpy(), strict=True):
            known, border = true != IGNORE, near_border(true)
            found.append(fragments(predicted))
            for place, part in enumerate((known & border, known & ~border)):
                right[place] += (predicted == true)[part].sum()
                all_[place] += part.sum()
    return {
        "mIoU": float(miou(confusion)),
        "accuracy": float(accuracy(confusion)),
        "speckle": float(np.mean(found)),
        "accuracy at borders": float(right[0] / all_[0]),
        "accuracy inside": float(right[1] / all_[1]),
    }


if __name__ == "__main__":
    if len(sys.argv) < 3:
        raise SystemExit(__doc__)
    for name in sys.argv[2:]:
        print(name, ", ".join(f"{key} {value:.4f}" for key, value in scores(name, sys.argv[1]).items()), flush=True)
