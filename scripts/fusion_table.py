"""What fusion over views repairs: spoiled true labels, with and without it, scored in held-out views of rooms.

    python scripts/fusion_table.py small ROOMS [TARGETS]

Labels of the input views are spoiled by view: a share of their regions gets another class, at the same probability of 0.9 as the others, and
borders move by up to 3 px. Rows: each Gaussian keeps the class of its own pixel ("none"), views are fused ("fused"), or the nearest input view's labels
are warped to the target by its rendered depth ("warped"). Differences come with 95 % bootstrap intervals over scenes. "changes" is the share of
points whose class depends on which of two input views one asks, where the true depths of both agree within 5 %. TARGETS per scene, 2 unless given.
"""

from __future__ import annotations

import sys
from collections import defaultdict
from itertools import combinations

import numpy as np
import torch
from jaxtyping import Float, UInt8
from scipy import ndimage
from shared import share_of_same_class
from torch import Tensor

from semgs.data.scenes import open_scenes
from semgs.data.tables.classes import SCANNET20
from semgs.data.views import Views, joined
from semgs.evaluation.frames.frame_plan import Task, make_plan
from semgs.evaluation.frames.protocols import neighbours
from semgs.evaluation.frames.reading import read_views
from semgs.geometry.cameras import back_project, project
from semgs.geometry.fusion import fuse_classes
from semgs.model.weights.load import load
from semgs.objectives.metrics import confusion_matrix, miou
from semgs.rendering.rendering import likeliest
from semgs.scene.encoding import Encoding

LEVELS = (0.0, 0.1, 0.2, 0.4)
SURE = 0.9
SHIFT_PX = 3.0
SAME = 0.05
CLASSES = len(SCANNET20)


def spoiled(
    labels: UInt8[np.ndarray, "h w"], share: float, generator: np.random.Generator
) -> Float[Tensor, "class h w"]:
    """Labels with moved borders and wrong regions, as probabilities."""
    h, w = labels.shape
    flow = [ndimage.zoom(generator.uniform(-SHIFT_PX, SHIFT_PX, (7, 9)), (h / 7, w / 9), order=1)[:h, :w] for _ in "yx"]
    y, x = np.mgrid[:h, :w]
    moved = labels[
        np.clip(np.rint(y + flow[0]), 0, h - 1).astype(int), np.clip(np.rint(x + flow[1]), 0, w - 1).astype(int)
    ]
    found = moved.copy()
    for index in np.unique(moved[moved < CLASSES]):
        regions, count = ndimage.label(moved == index)
        for region in range(1, count + 1):
            if generator.random() < share:
                found[regions == region] = (index + generator.integers(1, CLASSES)) % CLASSES
    one_hot = torch.nn.functional.one_hot(torch.from_numpy(found).long().clamp(max=CLASSES), CLASSES + 1)[..., :CLASSES]
    rest = (1 - SURE) / (CLASSES - 1)
    certain = (rest + (SURE - rest) * one_hot).float().permute(2, 0, 1)
    return torch.where(torch.from_numpy(found) < CLASSES, certain, torch.tensor(1 / CLASSES))


def warped_labels(labels: Tensor, context: Views, depths: Tensor, target: Views) -> Tensor:
    """The labels of one view at another, by the rendered depth of the latter; without depth, those of the same pixel."""
    points = back_project(depths.double(), target.cameras).flatten(end_dim=-2)
    x, y, z = project(points, context.cameras[0]).unbind(-1)
    h, w = target.size
    inside = (z > 0) & (x >= 0) & (x < w) & (y >= 0) & (y < h)
    place = y.clamp(0, h - 1).long() * w + x.clamp(0, w - 1).long()
    return torch.where(inside, labels.flatten()[torch.where(inside, place, 0)], labels.flatten()).view(h, w)


@torch.no_grad()
def measured(task: Task, number: int, model: object) -> dict[tuple[float, str], tuple[Tensor, float]]:
    """Confusion matrix and changes of each level and row on one target."""
    read = read_views(task)
    contexts, target = joined([read[place] for place in task.sample.contexts]), read[task.sample.target]
    encoding: Encoding = model(contexts.changed(labels=None, depths=None))  # type: ignore[operator]
    found, pairs = {}, list(combinations(range(len(contexts)), 2))
    for level in LEVELS:
        generator = np.random.default_rng((number, round(100 * level)))
        assert contexts.labels is not None
        said = torch.stack([spoiled(one.numpy(), level, generator) for one in contexts.labels])
        agreed = fuse_classes(said, encoding.depths, encoding.depth_spread, contexts.cameras)
        depths = None
        for row, maps in (("none", said), ("fused", agreed)):
            rendering = encoding.with_classes(maps, SCANNET20).render(target.cameras)
            depths = rendering.depths
            found[level, row] = (
                _scored(likeliest(rendering.semantics[0]), target),
                1 - share_of_same_class(maps.argmax(1), contexts, pairs, SAME),
            )
        nearest = warped_labels(said[0].argmax(0), contexts.select([0]), depths, target)
        found[level, "warped"] = _scored(nearest.to(torch.uint8), target), float("nan")
    return found


def _scored(labels: Tensor, target: Views) -> Tensor:
    return confusion_matrix(labels[None], target.labels, CLASSES)


def interval(before: list[Tensor], after: list[Tensor]) -> str:
    """Difference of mIoU of summed confusion matrices, one for each scene, and its 95 % interval."""
    generator = np.random.default_rng(0)
    first, second = torch.stack(before), torch.stack(after)
    drawn = [generator.integers(0, len(first), len(first)) for _ in range(1000)]
    gains = sorted(float(miou(second[one].sum(0)) - miou(first[one].sum(0))) for one in drawn)
    return f"{float(miou(second.sum(0)) - miou(first.sum(0))):+.3f} ({gains[25]:+.3f} to {gains[974]:+.3f})"


def main(weights: str, rooms: str, targets: int = 2) -> None:
    """Print the table."""
    model = load(weights).eval()
    scenes = open_scenes(rooms)
    print(
        "| N | regions spoiled | none | fused | warped | fused - none | fused - warped | changes, none | changes, fused |"
    )
    print("|---:|---:|---:|---:|---:|---|---|---:|---:|")
    for views in (2, 3, 4):
        matrices: dict = defaultdict(lambda: defaultdict(lambda: torch.zeros(CLASSES, CLASSES, dtype=torch.int64)))
        changed: dict = defaultdict(list)
        for scene in scenes:
            tasks = make_plan("neighbours", neighbours, [scene], [views]).tasks[:targets]
            for number, task in enumerate(tasks):
                for key, (matrix, share) in measured(task, number, model).items():
                    matrices[key][scene.name] += matrix
                    changed[key].append(share)
        for level in LEVELS:
            rows = {row: list(matrices[level, row].values()) for row in ("none", "fused", "warped")}
            scores = " | ".join(f"{float(miou(torch.stack(rows[row]).sum(0))):.3f}" for row in rows)
            said = " | ".join(f"{np.mean(changed[level, row]):.3f}" for row in ("none", "fused"))
            gains = f"{interval(rows['none'], rows['fused'])} | {interval(rows['warped'], rows['fused'])}"
            print(f"| {views} | {level:.0%} | {scores} | {gains} | {said} |", flush=True)


if __name__ == "__main__":
    if len(sys.argv) not in (3, 4):
        raise SystemExit(__doc__)
    main(sys.argv[1], sys.argv[2], *(int(one) for one in sys.argv[3:]))
