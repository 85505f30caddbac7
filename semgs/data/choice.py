"""Choice of views: which frames are the contexts, which are left to compare with, and why.

Frames are judged by what they see and from where, never by their position in the file. Two frames go well together if they see
the same things, from places that differ by about a tenth of the distance to them: nearer gives no depth, farther no matches.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from semgs.data.depth_range import DepthRange
from semgs.data.parallax import Seen
from semgs.data.scene import Scene
from semgs.files.errors import InputError

IDEAL_BASELINE = (0.05, 0.15)
"""Of the middle depth; the preference peaks at their geometric mean and falls off beyond."""

STEEPNESS = 0.72
"""Standard deviation of the preference in the logarithm of the baseline: 0.75 at the ends of the ideal band, 0.1 at 0.0185 and 0.406."""

DRAWN_FROM = 40
"""Frames that the others of a training sample are drawn from."""

CANDIDATES = 300
"""Of more frames than this, so many spread evenly are considered as contexts: their neighbours show nearly the same."""

TARGETS = 4
LEAST_SEEN = 0.5
"""A target has to share at least this part of what it sees with a context."""

GRID = 10
WIDEST_ANGLE = np.radians(60)
"""From directions further apart than this a surface is not the same to see."""


@dataclass(frozen=True)
class Choice:
    """Which frames to use.

    Attributes:
        context: positions of the input views, ascending unless the user gave another order.
        targets: positions of the held-out views, ascending; may be empty.
        reason: why, one sentence.
        depth_range: near and far of the input views, by which targets were chosen and with which everything is reconstructed; of a
            training sample, those of its whole scene.
    """

    context: tuple[int, ...]
    targets: tuple[int, ...]
    reason: str
    depth_range: DepthRange


def choose(scene: Scene, count: int) -> Choice:
    """The `count` frames that go best together as contexts, and the frames between them as targets.

    The first two are the pair with the most overlap at the middle depth and a baseline near 5 to 15 % of it; each further one
    goes best, by the same measure, with the nearest of those chosen, so that views are added beside them and show more.

    Raises:
        ValueError: `count` is less than 2 or more than there are usable frames.
    """
    _check_count(scene, count)
    features: dict[int, Seen] = {}
    bounds = scene.depth_range(features=features)
    few = np.unique(np.linspace(0, len(scene) - 1, min(len(scene), max(CANDIDATES, count))).round().astype(int))
    geometry = _Geometry(scene, bounds.middle, few)
    overlaps, baselines = geometry.overlaps(), geometry.baselines()
    preference = _preference(baselines / bounds.middle)
    scores = overlaps * preference
    np.fill_diagonal(scores, -1)
    chosen = [int(index) for index in np.unravel_index(np.argmax(scores), scores.shape)]
    while len(chosen) < count:
        nearest = np.array(chosen)[np.argmin(baselines[:, chosen], axis=1)]
        fit = scores[np.arange(len(few)), nearest]
        fit[chosen] = -1
        chosen.append(int(np.argmax(fit)))
    context = tuple(sorted(int(few[index]) for index in chosen))
    return _with_targets(scene, context, scene.depth_range(context, features), "chosen: ")


def given(scene: Scene, context: Sequence[int | str]) -> Choice:
    """The frames that the user named as contexts, in that order, and the frames between them as targets.

    Raises:
        ValueError: there are fewer than two, one comes twice, or the scene has no such frame.
    """
    indices = tuple(scene.index(frame) for frame in context)
    _check_count(scene, len(indices))
    if len(set(indices)) != len(indices):
        raise ValueError(f"the context views are {', '.join(map(str, context))}; expected different frames")
    return _with_targets(scene, indices, scene.depth_range(indices), "as asked: ")


def drawn(scene: Scene, bounds: DepthRange, contexts: int, targets: int, rng: np.random.Generator) -> Choice:
    """Frames for training: contexts that go together by the measure of `choose`, and targets between and around them, by chance.

    The first context is any frame. Each further one is drawn by how well it goes with the nearest of those drawn; targets are
    drawn from the frames that share enough of what they see with a context.

    Args:
        scene: to draw from.
        bounds: near and far of the scene.
        contexts: how many input views.
        targets: how many others.
        rng: the random numbers; of the same state, the same frames.

    Raises:
        InputError: the scene has fewer frames than that.
    """
    if contexts + targets > len(scene):
        raise InputError(
            scene.path,
            f"at least {contexts + targets} usable frames, for {contexts} input views and {targets} to compare with",
            f"{len(scene)}",
        )
    first = int(rng.integers(len(scene)))
    few = np.array([first, *_beside(scene, first, bounds, max(DRAWN_FROM, contexts + targets), rng)])
    geometry = _Geometry(scene, bounds.middle, few)
    overlaps, baselines = geometry.overlaps(), geometry.baselines()
    scores = overlaps * _preference(baselines / bounds.middle)
    chosen = [0]
    while len(chosen) < contexts:
        nearest = np.array(chosen)[np.argmin(baselines[:, chosen], axis=1)]
        chosen.append(_one_of(scores[np.arange(len(few)), nearest], overlaps[:, chosen].max(axis=1), chosen, rng))
    shared = overlaps[:, chosen].max(axis=1)
    others: list[int] = []
    while len(others) < targets:
        others.append(_one_of((shared >= LEAST_SEEN).astype(float), shared, [*chosen, *others], rng))
    context = tuple(sorted(int(few[index]) for index in chosen))
    return Choice(context, tuple(sorted(int(few[index]) for index in others)), "drawn", bounds)


def _beside(scene: Scene, first: int, bounds: DepthRange, count: int, rng: np.random.Generator) -> np.ndarray:
    """Frames that may go with one: some of those that look a similar way from not too far, or else the nearest."""
    poses = np.stack([frame.world_from_camera for frame in scene.frames])
    distance = np.linalg.norm(poses[:, :3, 3] - poses[first, :3, 3], axis=1)
    alike = poses[:, :3, 2] @ poses[first, :3, 2] > np.cos(WIDEST_ANGLE)
    others = np.arange(len(scene)) != first
    fit = np.flatnonzero(others & alike & (distance <= 4 * IDEAL_BASELINE[1] * bounds.middle))
    few = rng.permutation(fit)[:count]
    if len(few) < count:
        rest = np.setdiff1d(np.flatnonzero(others), few)
        few = np.concatenate((few, rest[np.argsort(distance[rest], kind="stable")][: count - len(few)]))
    return few


def _one_of(fit: np.ndarray, otherwise: np.ndarray, taken: Sequence[int], rng: np.random.Generator) -> int:
    """An index drawn in proportion to `fit`, none of those taken; where nothing fits, the one that is largest `otherwise`."""
    fit, otherwise = fit.copy(), otherwise.copy()
    fit[list(taken)], otherwise[list(taken)] = 0, -1
    total = fit.sum()
    return int(rng.choice(len(fit), p=fit / total)) if total > 0 else int(np.argmax(otherwise))


class _Geometry:
    """The cameras of some frames as arrays, and what they share."""

    def __init__(self, scene: Scene, depth: float, indices: Sequence[int] | np.ndarray) -> None:
        frames = [scene.frames[index] for index in indices]
        lenses = {frame.lens: frame.lens.intrinsics for frame in frames}
        poses = np.stack([frame.world_from_camera for frame in frames])
        intrinsics = np.stack([lenses[frame.lens] for frame in frames])
        rotations, self.centres = poses[:, :3, :3], poses[:, :3, 3]
        self.sizes = np.array([frame.lens.size[::-1] for frame in frames], dtype=np.float64)
        self.projections = intrinsics @ rotations.mT
        steps = (np.arange(GRID) + 0.5) / GRID
        grid = np.stack(np.meshgrid(steps, steps), axis=-1).reshape(1, -1, 2) * self.sizes[:, None]
        pixels = np.concatenate((grid, np.ones_like(grid[..., :1])), axis=-1)
        rays = depth * pixels @ np.linalg.inv(self.projections).mT
        self.points = self.centres[:, None] + rays
        self.directions = rays / np.linalg.norm(rays, axis=-1, keepdims=True)

    def baselines(self) -> np.ndarray:
        """Distances between the cameras [n n]."""
        return np.linalg.norm(self.centres[:, None] - self.centres, axis=-1)

    def overlaps(self) -> np.ndarray:
        """How much each pair shares of what it sees at the middle depth, the smaller of both directions [n n]."""
        seen = np.stack([self.seen_by(index) for index in range(len(self.centres))], axis=1)
        return np.minimum(seen, seen.T)

    def seen_by(self, index: int) -> np.ndarray:
        """The part of what each frame sees at the middle depth that frame `index` sees too, from a similar direction [n]."""
        towards = self.points - self.centres[index]
        x, y, depth = np.moveaxis(towards @ self.projections[index].T, -1, 0)
        width, height = self.sizes[index]
        inside = (depth > 0) & (x >= 0) & (x < width * depth) & (y >= 0) & (y < height * depth)
        cosine = (towards * self.directions).sum(-1) / np.sqrt((towards * towards).sum(-1))
        return (inside & (cosine > np.cos(WIDEST_ANGLE))).mean(axis=1)


def _check_count(scene: Scene, count: int) -> None:
    """Refuse a number of context views that cannot be.

    Raises:
        ValueError: it is less than 2 or more than there are usable frames.
    """
    if not 2 <= count <= len(scene):
        raise ValueError(
            f"{count} context view{'' if count == 1 else 's'} asked for; expected 2 to {len(scene)}, the number of usable frames of {scene.path}"
        )


def _preference(relative: np.ndarray) -> np.ndarray:
    """How good a baseline is, as a part of the middle depth: 1 in the middle of the ideal band, towards 0 far from it."""
    best = (IDEAL_BASELINE[0] * IDEAL_BASELINE[1]) ** 0.5
    return np.exp(-0.5 * (np.log(np.maximum(relative, 1e-9) / best) / STEEPNESS) ** 2)


def _with_targets(scene: Scene, context: tuple[int, ...], bounds: DepthRange, prefix: str) -> Choice:
    """The choice of these contexts: its targets and its reason.

    Targets are up to `TARGETS` frames spread evenly over those between the contexts in file order, or else the nearest others; all see
    much of what the contexts see.
    """
    between = [index for index in range(min(context) + 1, max(context)) if index not in context]
    others = [index for index in range(len(scene)) if index not in context]
    targets = _seen_enough(scene, context, between, bounds)
    if targets:
        spread = np.linspace(0, len(targets) - 1, min(len(targets), TARGETS)).round().astype(int)
        targets = [targets[index] for index in spread]
    else:
        centres = np.stack([frame.world_from_camera[:3, 3] for frame in scene.frames])
        distance = np.linalg.norm(centres[:, None] - centres[list(context)], axis=-1).min(axis=1)
        nearest = sorted(others, key=lambda index: (distance[index], index))[: 4 * TARGETS]
        targets = sorted(_seen_enough(scene, context, nearest, bounds)[:TARGETS])
    return Choice(context, tuple(targets), prefix + _reason(scene, context, bounds), bounds)


def _seen_enough(scene: Scene, context: Sequence[int], frames: Sequence[int], bounds: DepthRange) -> list[int]:
    """Those of some frames that share at least `LEAST_SEEN` of what they see with a context, in the order given."""
    if len(frames) > CANDIDATES:
        frames = [frames[index] for index in np.linspace(0, len(frames) - 1, CANDIDATES).round().astype(int)]
    if not frames:
        return []
    geometry = _Geometry(scene, bounds.middle, [*context, *frames])
    shared = np.max([geometry.seen_by(index) for index in range(len(context))], axis=0)[len(context) :]
    return [frame for frame, part in zip(frames, shared, strict=True) if part >= LEAST_SEEN]


def _reason(scene: Scene, context: Sequence[int], bounds: DepthRange) -> str:
    """One sentence with the figures of the contexts."""
    geometry = _Geometry(scene, bounds.middle, context)
    pairs = np.triu_indices(len(context), 1)
    overlaps, baselines = geometry.overlaps()[pairs], geometry.baselines()[pairs]
    names = ", ".join(f"{index} ({scene.frames[index].name})" for index in context)
    unit = " m" if scene.unit == "metric" else ""
    share = _span(f"{overlaps.min():.0%}", f"{overlaps.max():.0%}")
    near, far = baselines.min(), baselines.max()
    relative = _span(f"{near / bounds.middle:.0%}", f"{far / bounds.middle:.0%}")
    apart = f"{_span(f'{near:.2g}', f'{far:.2g}')}{unit} ({relative} of it)"
    parallax = "" if far > 0.005 * bounds.middle else "; there is no parallax, so depth is a guess"
    return (
        f"frames {names} share {share} of what they see at the middle depth of {bounds.middle:.2g}{unit} "
        f"and are {apart} apart{parallax}"
    )


def _span(least: str, most: str) -> str:
    """Two figures as a span, or as one where they read the same."""
    return least if least == most else f"{least} to {most}"
