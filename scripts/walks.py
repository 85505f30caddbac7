"""How good one scene of a whole walk is, against single windows: scores of held-out frames, consistency between views, time and memory.

    python scripts/walks.py SCENE [SCENE ...] [--every 5] [--voxel 0.01]

Every fifth frame is held out. The others pass through `semgs.mapping.mapper.Mapper` in their order. Each held-out frame is then rendered from

- merged: the scene of the whole walk;
- chosen: the window that the choice of views would take for this frame: of the eight frames that share most with it, the pair with the best product of
  overlap, preferred baseline and the share of the frame that it sees (true depth, if there is some);
- best: for each score, the best of that window and of all windows of the walk that see half of the frame, in hindsight.

`same class` is the share of surface points, seen by two held-out frames in turn at equal true depth, that have the same likeliest class in both.
"""

from __future__ import annotations

import argparse
import itertools
import resource
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from time import perf_counter

import numpy as np
import torch
from shared import share_of_same_class
from torch import Tensor

from semgs.data.choosing.choice import preference
from semgs.data.choosing.covisibility import Covisibility, DepthGrids
from semgs.data.scene import Scene
from semgs.data.scenes import open_scene
from semgs.data.views import Views
from semgs.mapping.mapper import Mapper, Merged
from semgs.mapping.stream import VOXEL
from semgs.model.encode import encode
from semgs.model.semgs import SemGS
from semgs.model.weights.load import load
from semgs.reconstruction.scores import scores
from semgs.rendering.rendering import Rendering, likeliest
from semgs.scene.encoding import Encoding

CANDIDATES = 8
"""Frames that the chosen window is taken from."""

SAME_DEPTH = 0.02
"""A point is seen by another frame if its depth there is that of the surface to this fraction."""

SCORES = ("psnr", "miou", "depth_abs_rel")
LARGER_IS_BETTER = {"psnr": True, "miou": True, "depth_abs_rel": False}


@dataclass(frozen=True)
class Walk:
    """A recording with its held-out frames.

    Attributes:
        scene: the recording.
        used, held: positions of the frames that are used and of those that are held out.
        targets: the held-out frames.
    """

    scene: Scene
    used: tuple[int, ...]
    held: tuple[int, ...]
    targets: Views

    @classmethod
    def of(cls, path: Path, every: int) -> Walk:
        """Open a recording and hold out every so many frames."""
        scene = open_scene(path)
        held = tuple(range(every // 2, len(scene), every))
        used = tuple(index for index in range(len(scene)) if index not in held)
        return cls(scene, used, held, scene.read(held, None, scene.depth_range()))


class Windows:
    """Encodes windows of a walk once each."""

    def __init__(self, walk: Walk, network: SemGS) -> None:
        self._walk, self._network = walk, network
        self._bounds = walk.scene.depth_range()
        self.found: dict[tuple[int, ...], Encoding] = {}

    def __call__(self, positions: Sequence[int], views: Views | None = None) -> Encoding:
        """The encoding of the frames at these positions of the scene."""
        key = tuple(positions)
        if key not in self.found:
            seen = self._walk.scene.read(key, self._walk.targets.size, self._bounds) if views is None else views
            self.found[key] = encode(self._network, seen).encoding
        return self.found[key]


def mapped(walk: Walk, windows: Windows, **options) -> Mapper:
    """The mapper after all used frames of a walk."""
    bounds = walk.scene.depth_range()
    mapper = Mapper(lambda numbers, views: windows([walk.used[number] for number in numbers], views), bounds, **options)
    for position in walk.used:
        mapper.add(walk.scene.read([position], walk.targets.size, bounds))
    return mapper


def chosen_pair(walk: Walk, grids: DepthGrids, target: int) -> tuple[int, int]:
    """The window that the choice of views would take for one held-out frame."""
    typical = walk.scene.depth_range().typical
    few = [target, *walk.used]
    together = Covisibility.of(walk.scene, few, grids.of(few, typical))
    overlaps = together.overlaps()
    depths = np.sqrt(together.medians[:, None] * together.medians)
    fit = overlaps * preference(together.baselines / depths)
    some = np.argsort(-overlaps[0, 1:], kind="stable")[:CANDIDATES] + 1
    pairs = list(itertools.combinations(sorted(some.tolist()), 2))
    best = max(pairs, key=lambda pair: fit[pair] * together.covered(pair)[0])
    return few[best[0]], few[best[1]]


def numbers_of(rendering: Rendering, truth: Views) -> list[dict[str, float]]:
    """The scores of each view by name, those that exist."""
    comparable = truth if rendering.classes == truth.classes else truth.changed(labels=None)
    return [
        {name: value for name in SCORES if (value := getattr(one, name)) is not None}
        for one in scores(rendering, comparable)
    ]


def same_class(labels: Tensor, truth: Views) -> float:
    """Of the points that a view and the next one see at the same true depth, the share with the same class in both."""
    if truth.depths is None:
        return float("nan")
    return share_of_same_class(labels, truth, itertools.pairwise(range(len(truth))), SAME_DEPTH)


@dataclass(frozen=True)
class Singles:
    """What single windows reach: scores of each held-out frame, and consistency.

    Attributes:
        chosen, best: scores by name.
        same: share of points with the same class in two views of the chosen windows.
    """

    chosen: list[dict[str, float]]
    best: list[dict[str, float]]
    same: float


def singles(walk: Walk, windows: Windows, walked: Sequence[tuple[int, ...]]) -> Singles:
    """Scores of single windows.

    Args:
        walk: the walk.
        windows: its windows.
        walked: positions of the windows that the mapper encoded.
    """
    grids = DepthGrids(walk.scene)
    typical = walk.scene.depth_range().typical
    chosen, best, labels = [], [], []
    for place, target in enumerate(walk.held):
        truth = walk.targets.select([place])
        own = windows(chosen_pair(walk, grids, target)).render(truth.cameras)
        chosen.append(numbers_of(own, truth)[0])
        labels.append(likeliest(own.semantics)[0] if own.semantics is not None else torch.zeros(truth.size))
        tried = [chosen[-1]]
        for window in walked:
            every = [target, *window]
            together = Covisibility.of(walk.scene, every, grids.of(every, typical))
            if together.covered(range(1, len(every)))[0] >= 0.5:
                tried += numbers_of(windows(window).render(truth.cameras), truth)
        best.append({name: (max if LARGER_IS_BETTER[name] else min)(one[name] for one in tried) for name in chosen[-1]})
    return Singles(chosen, best, same_class(torch.stack(labels), walk.targets))


def of_merged(walk: Walk, merged: Merged) -> tuple[list[dict[str, float]], float]:
    """Scores of the merged scene for each held-out frame, and consistency."""
    rendering = merged.encoding.render(walk.targets.cameras)
    labels = torch.zeros(len(walk.held), *walk.targets.size)
    if rendering.semantics is not None:
        labels = likeliest(rendering.semantics)
    return numbers_of(rendering, walk.targets), same_class(labels, walk.targets)


def mean(rows: Sequence[dict[str, float]], name: str) -> str:
    """The mean of a score, as text."""
    found = [row[name] for row in rows if name in row]
    return f"{np.mean(found):.3f}" if found else "-"


def main(arguments: Sequence[str] | None = None) -> None:
    """Print a table with three rows for each recording."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0] if __doc__ else "")
    parser.add_argument("scenes", nargs="+", type=Path)
    parser.add_argument("--every", type=int, default=5)
    parser.add_argument("--views", type=int, default=2)
    parser.add_argument("--voxel", type=float, default=VOXEL)
    given = parser.parse_args(arguments)
    network = load("small")
    print("| walk | from | PSNR | mIoU | depth error | same class | keyframes | Gaussians | s a frame | peak MB |")
    print("|---|---|---|---|---|---|---|---|---|---|")
    for path in given.scenes:
        walk = Walk.of(path, given.every)
        windows = Windows(walk, network)
        start = perf_counter()
        mapper = mapped(walk, windows, views=given.views, voxel=given.voxel or None)
        merged = mapper.merged()
        seconds = (perf_counter() - start) / len(walk.used)
        if merged is None:
            print(f"| {path} | nothing usable | | | | | | | | |")
            continue
        peak = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024
        own, same = of_merged(walk, merged)
        other = singles(walk, windows, list(windows.found))
        name = f"{path.parent.name}/{path.name}, {len(walk.scene)} frames"
        size = f"{len(merged.names)} | {len(merged.encoding.gaussians):,} | {seconds:.2f} | {peak:.0f}"
        for title, rows, share, rest in (
            ("merged", own, f"{same:.3f}", size),
            ("chosen", other.chosen, f"{other.same:.3f}", "2 | | |"),
            ("best", other.best, "", "| | |"),
        ):
            numbers = " | ".join(mean(rows, score) for score in SCORES)
            print(f"| {name} | {title} | {numbers} | {share} | {rest} |", flush=True)


if __name__ == "__main__":
    main()
