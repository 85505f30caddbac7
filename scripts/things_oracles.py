"""What limits finding things: boxes and panoptic quality with true classes, depth or grouping, and with classes that are pooled over groups.

    python scripts/things_oracles.py small ROOMS [ROOMS ...] --rooms 24

The rooms need true classes, depth and things, as `semgs rooms` draws them. The input views are the two frames beside each inner frame. Each Gaussian can get the true
class, depth and thing of the first pixel of its block. Boxes are scored as `semgs evaluate --panoptic coco` does, and panoptic quality at the Gaussians of the input
views instead of held-out pixels, so that nothing is rendered. Prints a Markdown table for each folder.

Rows: who gives classes, depth and grouping. A true thing gets the class with the highest mean probability. "kin" pools confusable classes, "all" every class of things:
DBSCAN groups Gaussians of any class of a pool, and the class with the highest mean probability names the group. "join S" starts from groups of single classes and joins
those that touch, the most alike first, while the Bhattacharyya coefficient of their mean probabilities is at least S.
"""

from __future__ import annotations

import argparse
import sys
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import torch
from torch.nn.functional import one_hot

from semgs.data.scenes import open_scene, scene_paths
from semgs.data.tables.classes import IGNORE, ClassTable
from semgs.data.views import joined as together
from semgs.evaluation.frames.protocols import neighbours
from semgs.evaluation.scoring.panoptic import count_boxes, count_segments, qualities, tally, thing_classes, true_boxes
from semgs.files.errors import InputError
from semgs.model.encode import encode
from semgs.model.weights.load import load
from semgs.robotics.boxes import Box, box_of
from semgs.robotics.floor import level_from_world
from semgs.robotics.objects import CONFUSED, connected, joined
from semgs.scene.scene_file import SavedScene
from semgs.scene.upright import up_of

SIZE = (240, 320)
GAP, LEAST_OPACITY, LEAST_SUM, LEAST_SIDE = 0.1, 0.1, 150.0, 0.1
"""The defaults of `semgs.objects`."""


@dataclass(frozen=True, eq=False)
class Pair:
    """Two input views: arrays of their Gaussians [g ...], and the truth. Points have z up."""

    points: dict[str, np.ndarray]
    chances: dict[str, np.ndarray]
    weights: np.ndarray
    labels: np.ndarray
    numbers: np.ndarray
    boxes: list[tuple[int, Box]]
    grid: tuple[int, int]
    classes: ClassTable


@torch.no_grad()
def read_pairs(network, paths: Sequence[Path], every: int = 1) -> Iterator[Pair]:
    """The pairs of the protocol in some rooms, or one in so many, encoded."""
    for path in paths:
        scene = open_scene(path)
        for sample in neighbours(scene, 2)[::every]:
            bounds = scene.depth_range(sample.contexts, stated=True)
            singles = [scene.read([at], SIZE, bounds, fit="stretch") for at in sample.contexts]
            views = together(singles)
            numbers = [scene.frames[at].things(one) for at, one in zip(sample.contexts, singles, strict=True)]
            if views.labels is None or views.depths is None or any(one is None for one in numbers):
                raise InputError(path, "a scene with true classes, depth and things", "one without")
            encoding = encode(network, views.changed(labels=None, depths=None)).encoding
            first = (slice(None), slice(None, None, encoding.stride), slice(None, None, encoding.stride))
            depths = encoding.per_pixel(views.depths[first])
            depths = torch.where(depths > 0, depths, encoding.placed_depths(views.cameras))
            true = encoding.with_depths(depths, views.cameras).gaussians
            up = up_of(SavedScene.of(encoding, views, unit="metric")).direction
            level = level_from_world(up.tolist())
            boxes = true_boxes(list(zip(singles, numbers, strict=True)), views.classes, level)
            own, labels = encoding.gaussians, views.labels[first].flatten().long()
            chances, count = own.semantic.features, len(views.classes)
            exact = torch.where((labels < count)[:, None], one_hot(labels.clamp(max=count - 1), count), chances)
            means = {"own": own.means, "true": true.means}
            yield Pair(
                {name: one.double().numpy() @ level.T for name, one in means.items()},
                {"own": chances.numpy(), "true": exact.numpy()},
                own.opacities.double().numpy(),
                labels.numpy(),
                np.stack(numbers)[first].ravel().astype(np.int64),
                boxes,
                encoding.grid,
                views.classes,
            )


def class_sums(groups, chances, weights) -> np.ndarray:
    """The sum of the distributions of each group [n + 1 class], weighted by opacity."""
    return np.stack([np.bincount(groups, weights * one) for one in chances.T], -1)


def things(pair: Pair, classes: str, depth: str, grouping: str) -> tuple[np.ndarray, list[tuple[int, Box]], np.ndarray]:
    """The number of each Gaussian's thing, class and box of each thing, and the class of each Gaussian."""
    points, chances, weights = pair.points[depth], pair.chances[classes], pair.weights
    labels, names, some = chances.argmax(-1), pair.classes.names, list(thing_classes(pair.classes))
    kind, _, number = grouping.partition(" ")
    if kind == "true":
        groups = np.where(np.isin(pair.labels, some) & (weights >= LEAST_OPACITY), pair.numbers, 0)
    else:
        family = np.full(len(names), -1)
        family[some] = some
        for pool in {"kin": CONFUSED, "all": [[names[one] for one in some]]}.get(kind, ()):
            family[[names.index(one) for one in pool]] = names.index(pool[0])
        families = np.where(weights >= LEAST_OPACITY, family[labels], -1)
        groups = connected(families, points, weights, GAP)
    if kind == "join":
        groups = joined(groups, points, weights, chances, GAP, float(number))
    pooled = class_sums(groups, chances, weights)
    instances, found = np.zeros(len(points), np.int64), []
    for group in np.unique(groups[groups > 0]):
        members = groups == group
        label = int(labels[members][0]) if kind == "own" else some[pooled[group, some].argmax()]
        if weights[members].sum() >= LEAST_SUM and max((box := box_of(points[members])).size) >= LEAST_SIDE:
            found.append((label, box))
            instances[members], labels[members] = len(found), label
    return instances, found, labels


def score(pairs: Sequence[Pair], *choice: str) -> list[str]:
    """Recall and precision of boxes at IoU 0.25 and 0.5, panoptic quality, and that of classes of things alone."""
    boxes, counts = np.zeros(4), 0.0
    for pair in pairs:
        instances, found, labels = things(pair, *choice)
        boxes += count_boxes(pair.boxes, found)
        true = np.where(pair.labels < len(pair.classes), pair.labels, IGNORE)
        maps = [one.reshape(2, *pair.grid) for one in (true, pair.numbers, labels, instances)]
        for a, b, c, d in zip(*maps, strict=True):
            counts = counts + tally(count_segments((a, b), (c, d), pair.classes)).counts
    of_things = counts[list(thing_classes(pairs[0].classes))]
    values = [boxes[2] / boxes[0], boxes[2] / boxes[1], boxes[3] / boxes[0], boxes[3] / boxes[1]]
    return [f"{one:.3f}" for one in (*values, qualities(counts)[0], qualities(of_things)[0])]


def main() -> None:
    """Measure and print the tables."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("weights")
    parser.add_argument("data", nargs="+", type=Path)
    parser.add_argument("--rooms", type=int, default=24, help="at most this many of each folder")
    parser.add_argument("--every", type=int, default=1, help="one pair in so many of each room")
    arguments = parser.parse_args()
    network = load(arguments.weights).eval()
    choices = [(a, b, c) for c in ("own", "true") for b in ("own", "true") for a in ("own", "true")]
    choices += [("own", "own", kind) for kind in ("kin", "all", "join 0.7", "join 0.8", "join 0.9")]
    for data in arguments.data:
        pairs = list(read_pairs(network, scene_paths(data)[: arguments.rooms], arguments.every))
        print(f"\n{data.name}, {len(pairs)} pairs\n", flush=True)
        print(
            "| classes | depth | grouping | recall .25 | precision .25 | recall .5 | precision .5 | PQ | PQ of things |"
        )
        print("|" + " --- |" * 9)
        for choice in choices:
            print(f"| {' | '.join([*choice, *score(pairs, *choice)])} |", flush=True)


if __name__ == "__main__":
    try:
        main()
    except (InputError, ImportError) as error:
        sys.exit(f"error: {error}")
