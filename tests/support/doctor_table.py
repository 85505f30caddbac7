"""Counts how often `semgs doctor` names a planted mistake: `python tests/support/doctor_table.py FOLDER_OF_SCENES ... --cases 200`.

Each case is first marked decidable or not, by points of the measured depth (or, without depth, by matches that fit the right cameras): it is
decidable if the mistake moves half of the points that some pair of frames shares by more than 2 px.
"""

from __future__ import annotations

import argparse
from collections import Counter
from dataclasses import dataclass, field, replace
from functools import lru_cache
from itertools import combinations
from pathlib import Path

import cv2
import numpy as np
from planted_mistakes import PLANTED, SORTED_AS_TEXT, UNREGISTERED, Planted, Unregistered

from semgs.data.scene import Scene
from semgs.data.scenes import open_scene
from semgs.doctor.diagnosis import Diagnosis, Evidence, judge_cameras
from semgs.doctor.misses import misses, pair_misses
from semgs.doctor.mistakes import BAD_DEPTH
from semgs.doctor.rig import inverse, rig_of
from semgs.doctor.warps import find_depth_views
from semgs.sfm.matches import Matches, find_matches

MOVED_PX = 2.0
BAD = Planted(BAD_DEPTH.name, lambda rig, rng: rig)
"""It is planted in the depth maps, not in the cameras."""
ALL = (*PLANTED, SORTED_AS_TEXT, BAD)
STEP = 24
LEAST_POINTS = 20


@dataclass(frozen=True, eq=False)
class Tested:
    """A scene, its matches, and true matches of the same pairs or more."""

    scene: Scene
    evidence: Evidence
    truth: Matches


@lru_cache(maxsize=400)
def tested(path: Path) -> Tested:
    """Open a scene, match it, and find true matches."""
    scene = open_scene(path, needs_labels=False)
    matches = find_matches(scene)
    truth = true_matches(scene)
    if not len(truth):
        fits = misses(rig_of(scene.frames), matches) < 1
        truth = replace(
            matches,
            pair=matches.pair[fits], points=matches.points[fits], depths=matches.depths[fits], shrink=matches.shrink[fits],
        )  # fmt: skip
    return Tested(scene, Evidence(matches, find_depth_views(scene)), truth)


def true_matches(scene: Scene) -> Matches:
    """Points of measured depth on a grid, and where the given cameras see them in other frames that measured the same depth there."""
    depths = [frame.measured() if frame.lens.is_pinhole else None for frame in scene.frames]
    pairs, pair, points, both = [], [], [], []
    for i, j in combinations(range(len(scene)), 2):
        if depths[i] is None or depths[j] is None:
            continue
        first, second = scene.frames[i], scene.frames[j]
        height, width = first.lens.size
        column, row = np.meshgrid(np.arange(STEP // 2, width, STEP), np.arange(STEP // 2, height, STEP))
        z = depths[i][row, column].ravel().astype(np.float64)
        a = np.column_stack((column.ravel() + 0.5, row.ravel() + 0.5))
        rays = np.column_stack(((a - first.lens.centre) / first.lens.focal, np.ones(len(a))))
        poses = np.stack((first.world_from_camera, second.world_from_camera))
        motion = inverse(poses[1:])[0] @ poses[0]
        there = (rays * z[:, None]) @ motion[:3, :3].T + motion[:3, 3]
        b = there[:, :2] / np.maximum(there[:, 2:], 1e-6) * second.lens.focal + second.lens.centre
        inside = (z > 0) & (there[:, 2] > 0) & (b >= 0).all(1) & (b < second.lens.size[::-1]).all(1)
        x, y = b[inside].astype(int).T
        same = np.abs(depths[j][y, x] / there[inside, 2] - 1) < 0.03
        kept = np.flatnonzero(inside)[same]
        if len(kept) >= LEAST_POINTS:
            pair += [len(pairs)] * len(kept)
            pairs.append((i, j))
            points.append(np.stack((a[kept], b[kept]), axis=1))
            both.append(np.column_stack((z[kept], there[kept, 2])))
    if not pairs:
        return Matches(np.zeros((0, 2), int), np.zeros(0, int), np.zeros((0, 2, 2)), np.zeros((0, 2)), np.zeros((0, 2)))
    shrink = np.full((len(pair), 2), min(1.0, 480 / max(scene.frames[0].lens.size)))
    return Matches(np.array(pairs), np.array(pair), np.concatenate(points), np.concatenate(both), shrink)


@lru_cache(maxsize=400)
def unregistered(path: Path, focal: float) -> Tested:
    """The same with depth of a camera of its own."""
    right = tested(path)
    frames = tuple(
        frame if frame.depth is None else replace(frame, depth=Unregistered(frame.depth, focal))
        for frame in right.scene.frames
    )
    scene = replace(right.scene, frames=frames)
    evidence = Evidence(find_matches(scene), find_depth_views(scene))
    maps = [frame.measured() if frame.lens.is_pinhole else None for frame in frames]
    depths = np.full_like(right.truth.depths, np.nan)
    for index, (pair, points) in enumerate(zip(right.truth.pair, right.truth.points.astype(int), strict=True)):
        for side, frame in enumerate(right.truth.pairs[pair]):
            seen = maps[frame]
            column, row = points[side]
            if seen is not None and seen[row, column] > 0:
                depths[index, side] = seen[row, column]
    return Tested(scene, evidence, replace(right.truth, depths=depths))


def judge(one: Tested, planted: Planted | None, depth: bool, seed: int) -> tuple[Diagnosis, bool]:
    """The diagnosis of a case, and whether it is decidable."""
    evidence = one.evidence if depth else Evidence(one.evidence.matches.without_depth())
    truth = one.truth if depth else one.truth.without_depth()
    rig = rig_of(one.scene.frames)
    if planted is not None:
        rig = planted.make(rig, np.random.default_rng(seed))
    names = [frame.name for frame in one.scene.frames]
    found = judge_cameras(rig, evidence, one.scene.layout, names, metric=one.scene.unit == "metric")
    return found, len(truth) > 0 and float(np.nanmax(pair_misses(rig, truth))) > MOVED_PX


@dataclass
class Counts:
    """How often the doctor was right.

    Attributes:
        decidable, right: cases with a decidable mistake, and those of them in which it was named.
        undecidable, told: the other cases, and those of them whose mistake was named or listed as not excluded, or in which nothing could be said.
        intact, alarms: right cameras, and those of them that were called suspicious.
        confusion: of the decidable cases, by the planted mistake and what was said.
        lines: every wrong answer.
    """

    decidable: int = 0
    right: int = 0
    undecidable: int = 0
    told: int = 0
    intact: int = 0
    alarms: int = 0
    confusion: Counter[tuple[str, str]] = field(default_factory=Counter)
    lines: list[str] = field(default_factory=list)


def counted(paths: list[Path], cases: int) -> Counts:
    """Count until there are `cases` decidable and as many intact ones. Every second case has no depth."""
    order = np.random.default_rng(1).permutation(len(paths))
    counts = Counts()
    case = 0
    while min(counts.decidable, counts.intact) < cases:
        one = tested(paths[order[case % len(paths)]])
        depth = (case // len(paths) + case) % 2 == 0
        if counts.intact < cases:
            _count_intact(counts, one, depth, case)
        for planted in (ALL[case % len(ALL)], ALL[(case + 7) % len(ALL)]):
            if planted is SORTED_AS_TEXT and len(one.scene) <= 10:
                continue  # 0 to 9 have the same order both ways
            if planted is not BAD:
                _count_planted(counts, one, planted, depth, case, cases)
            elif one.evidence.matches.measured:
                wrong = unregistered(paths[order[case % len(paths)]], UNREGISTERED[case // len(ALL) % 2])
                _count_planted(counts, wrong, planted, True, case, cases)
        case += 1
    return counts


def counted_unregistered(paths: list[Path]) -> Counts:
    """Count every scene as it is and with depth of each sensor that is not registered."""
    counts = Counts()
    for path in paths:
        _count_intact(counts, tested(path), True, 0)
        for focal in UNREGISTERED:
            _count_planted(counts, unregistered(path, focal), BAD, True, 0, 2 * len(paths))
    return counts


def _count_intact(counts: Counts, one: Tested, depth: bool, case: int) -> None:
    found, _ = judge(one, None, depth, case)
    counts.intact += 1
    if found.verdict == "suspicious":
        counts.alarms += 1
        counts.lines.append(f"alarm: {one.scene.name}, {'with' if depth else 'without'} depth: {found.sentence}")


def _count_planted(counts: Counts, one: Tested, planted: Planted, depth: bool, case: int, most: int) -> None:
    found, decidable = judge(one, planted, depth, case)
    name = found.finding.mistake.name if found.finding else found.verdict
    right = name == planted.name
    if decidable and counts.decidable < most:
        counts.decidable += 1
        counts.right += right
        counts.confusion[short(planted.name), short(name)] += 1
    elif not decidable:
        right = right or found.verdict == "cannot tell" or any(one.name == planted.name for one in found.undecided)
        counts.undecidable += 1
        counts.told += right
    else:
        return
    if not right:
        kind = "missed" if decidable else "undecidable"
        said = (
            f"{kind}: {one.scene.name}, {'with' if depth else 'without'} depth, {short(planted.name)}: {found.sentence}"
        )
        counts.lines.append(said)


def short(name: str) -> str:
    """A name without its explanation."""
    return name.partition(" (")[0]


def main() -> None:
    """Print the table."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument(
        "folders", nargs="+", type=Path, help="scenes, or folders of scenes, with a transforms.json each"
    )
    parser.add_argument("--cases", type=int, default=200)
    parser.add_argument("--unregistered", action="store_true", help="count only depth that is not registered")
    options = parser.parse_args()
    cv2.setRNGSeed(0)
    folders = [
        path
        for folder in options.folders
        for path in ([folder] if (folder / "transforms.json").exists() else sorted(folder.iterdir()))
    ]
    paths = [path for path in folders if (path / "transforms.json").exists()]
    counts = counted_unregistered(paths) if options.unregistered else counted(paths, options.cases)
    print("\n".join(counts.lines))
    print(f"decidable: {counts.right} of {counts.decidable} named")
    print(f"undecidable: {counts.told} of {counts.undecidable} not excluded")
    print(f"intact: {counts.alarms} alarms in {counts.intact}")
    print("| planted | said | cases |\n|---|---|---|")
    for (planted, said), number in sorted(counts.confusion.items()):
        print(f"| {planted} | {said} | {number} |")


if __name__ == "__main__":
    main()
