"""Choice of views: which frames are the contexts, which are left to compare with, and why.

Frames are judged by what they see and from where, never by their position in the file. Two frames go well together if they see
the same things, from places that differ by about a tenth of the distance to them: nearer gives no depth, farther no matches.
How far away things are comes from depth maps or sparse points where the scene has them (`semgs.data.covisibility`).
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from itertools import zip_longest

import numpy as np

from semgs.data.covisibility import WIDEST_ANGLE, Covisibility, DepthGrids, flat
from semgs.data.depth_range import DepthRange
from semgs.data.parallax import Seen
from semgs.data.scene import Scene
from semgs.files.errors import InputError

IDEAL_BASELINE = (0.05, 0.15)
"""Of the depth; the preference peaks at their geometric mean and falls off beyond."""

STEEPNESS = 0.72
"""Standard deviation of the preference in the logarithm of the baseline: 0.75 at the ends of the ideal band, 0.1 at 0.0185 and 0.406."""

LEAST_SHARED = 0.3
"""A chosen context has to share at least this part of what it sees with another one, in both directions."""

DRAWN_FROM = 40
"""Frames that the others of a training sample are drawn from."""

CANDIDATES = 300
"""Of more frames than this, so many spread evenly are considered: their neighbours show nearly the same."""

CANDIDATES_TO_READ = 100
"""The same where the depth map of each has to be read."""

TARGETS = 4
LEAST_SEEN = 0.5
"""A target has to share at least this part of what it sees with the contexts."""

WELL_SEEN = 0.9
"""A target that shares this part is preferred: of one that shares less, scores tell mostly of what no context saw."""

GOOD_ENOUGH = 0.5
"""Contexts that leave such a target are preferred to better ones that leave none, if they are this part as good."""

TRIED = 1000
"""The most pairs of contexts that are looked at for such a target."""


@dataclass(frozen=True)
class Choice:
    """Which frames to use.

    Attributes:
        context: positions of the input views, ascending unless the user gave another order.
        targets: positions of the held-out views, ascending; may be empty.
        reason: why, one sentence.
        depth_range: near and far of the input views, by which targets were chosen and with which everything is reconstructed; of a
            training sample, those of its whole scene.
        notes: what the user should know of the choice, a sentence each.
    """

    context: tuple[int, ...]
    targets: tuple[int, ...]
    reason: str
    depth_range: DepthRange
    notes: tuple[str, ...] = ()


def choose(scene: Scene, count: int) -> Choice:
    """The `count` frames that go best together as contexts, and the frames between them as targets.

    The first two are the pair with the most overlap and a baseline near 5 to 15 % of the depth; each further one goes best, by the
    same measure, with the nearest of those chosen that it shares enough with, so that views are added beside them and show more.
    Frames that share less than `LEAST_SHARED` are never taken, so that there may be fewer than `count`; a note says so.

    Raises:
        ValueError: `count` is less than 2 or more than there are usable frames.
        InputError: no two frames share that much.
    """
    _check_count(scene, count)
    features: dict[int, Seen] = {}
    typical = scene.depth_range(features=features).typical
    grids = DepthGrids(scene)
    few = _spread(range(len(scene)), max(_most(grids), count))
    together = Covisibility(scene, few, grids.of(few, typical))
    overlaps, baselines = together.overlaps(), together.baselines
    depths = np.sqrt(together.medians[:, None] * together.medians)
    scores = np.where(overlaps >= LEAST_SHARED, overlaps * _preference(baselines / depths), -1)
    np.fill_diagonal(scores, -1)
    each_once = np.where(np.tri(len(few), dtype=bool), -1, scores)

    def leaves_target(chosen: Sequence[int]) -> bool:
        """Whether a frame that is not chosen is well covered by those that are."""
        covered = together.covered(chosen)
        covered[list(chosen)] = 0
        return bool(covered.max() >= WELL_SEEN)

    pair = _best(each_once.ravel(), lambda index: leaves_target(divmod(index, len(few))))
    if pair is None:
        np.fill_diagonal(overlaps, 0)
        raise InputError(
            scene.path,
            f"two frames that share {LEAST_SHARED:.0%} of what they see",
            f"{overlaps.max():.0%} at most",
            advice="name input views (--context) to take them all the same",
        )
    chosen = [int(index) for index in divmod(pair, len(few))]
    while len(chosen) < count:
        apart = np.where(overlaps[:, chosen] >= LEAST_SHARED, baselines[:, chosen], np.inf)
        fit = scores[np.arange(len(few)), np.array(chosen)[apart.argmin(axis=1)]]
        fit[chosen] = -1
        further = _best(fit, lambda index: leaves_target([*chosen, index]))
        if further is None:
            break
        chosen.append(further)
    context = tuple(sorted(int(few[index]) for index in chosen))
    notes = []
    if len(context) < count:
        notes.append(
            f"{len(context)} input views instead of {count}: no other frame shares {LEAST_SHARED:.0%} of what it sees with them."
        )
    return _with_targets(scene, grids, context, scene.depth_range(context, features), "chosen: ", notes)


def given(scene: Scene, context: Sequence[int | str]) -> Choice:
    """The frames that the user named as contexts, in that order, and the frames between them as targets.

    Raises:
        ValueError: there are fewer than two, one comes twice, or the scene has no such frame.
    """
    indices = tuple(scene.index(frame) for frame in context)
    _check_count(scene, len(indices))
    if len(set(indices)) != len(indices):
        raise ValueError(f"the context views are {', '.join(map(str, context))}; expected different frames")
    return _with_targets(scene, DepthGrids(scene), indices, scene.depth_range(indices), "as asked: ")


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
    together = Covisibility(scene, few, [flat(bounds.middle)] * len(few))
    overlaps, baselines = together.overlaps(), together.baselines
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


def consecutive(scene: Scene, bounds: DepthRange, contexts: int, targets: int, rng: np.random.Generator) -> Choice:
    """Frames for training that lie as those of the protocol `neighbours` do: a frame, the contexts around it, targets beside them.

    The first target is any inner frame, its contexts are the nearest in file order, and further targets are the next nearest.

    Args:
        scene: to draw from.
        bounds: near and far of the scene.
        contexts: how many input views.
        targets: how many others, at least 1.
        rng: the random numbers; of the same state, the same frames.

    Raises:
        InputError: the scene has fewer frames than that, or fewer than three.
    """
    wanted = max(contexts + targets, 3)
    if wanted > len(scene):
        raise InputError(
            scene.path,
            f"at least {wanted} usable frames, for {contexts} input views around one to compare with",
            f"{len(scene)}",
        )
    target = int(rng.integers(1, len(scene) - 1))
    forward = bool(rng.integers(2))
    order = around(target, len(scene), contexts + targets - 1, forward)
    return Choice(tuple(sorted(order[:contexts])), tuple(sorted((target, *order[contexts:]))), "consecutive", bounds)


def around(frame: int, frames: int, count: int, forward: bool = False) -> tuple[int, ...]:
    """The `count` nearest to one of `frames` in file order: alternately before and after it; where one side ends, the other fills.

    Args:
        forward: begin after it.
    """
    sides = [range(frame - 1, -1, -1), range(frame + 1, frames)]
    turns = zip_longest(*(reversed(sides) if forward else sides))
    return tuple([other for pair in turns for other in pair if other is not None][:count])


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
    """How good a baseline is, as a part of the depth: 1 in the middle of the ideal band, towards 0 far from it."""
    best = (IDEAL_BASELINE[0] * IDEAL_BASELINE[1]) ** 0.5
    return np.exp(-0.5 * (np.log(np.maximum(relative, 1e-9) / best) / STEEPNESS) ** 2)


def _best(fit: np.ndarray, leaves_target: Callable[[int], bool]) -> int | None:
    """The best of what is allowed (0 or more), or the best of those `GOOD_ENOUGH` beside it that leaves a target; None if nothing is."""
    order = np.argsort(-fit, kind="stable")[:TRIED].tolist()
    good = [index for index in order if fit[index] >= max(GOOD_ENOUGH * fit[order[0]], 0)]
    return next((index for index in good if leaves_target(index)), good[0] if good else None)


def _most(grids: DepthGrids) -> int:
    """How many frames are considered."""
    return CANDIDATES_TO_READ if grids.measured else CANDIDATES


def _spread(frames: Sequence[int], most: int) -> list[int]:
    """All frames, or the most that are wanted, spread evenly over them."""
    return [frames[round(step)] for step in np.linspace(0, len(frames) - 1, min(len(frames), most))]


def _with_targets(
    scene: Scene,
    grids: DepthGrids,
    context: tuple[int, ...],
    bounds: DepthRange,
    prefix: str,
    notes: Sequence[str] = (),
) -> Choice:
    """The choice of these contexts: its targets and its reason.

    Targets are up to `TARGETS` frames spread evenly over those between the contexts in file order, or else the nearest others, of which
    the contexts see `WELL_SEEN`. If there are none, they are those of which they see most, and a note says so.
    """
    between = [index for index in range(min(context) + 1, max(context)) if index not in context]
    others = [index for index in range(len(scene)) if index not in context]
    centres = np.stack([frame.world_from_camera[:3, 3] for frame in scene.frames])
    distance = np.linalg.norm(centres[:, None] - centres[list(context)], axis=-1).min(axis=1)
    nearest = sorted(others, key=lambda index: (distance[index], index))[: 4 * TARGETS]
    seen = _covered(scene, grids, context, [*_spread(between, _most(grids)), *nearest], bounds.typical)
    well = [index for index in seen if seen[index] >= WELL_SEEN]
    targets = _spread([index for index in well if index in between], TARGETS) or well[:TARGETS]
    if not targets:
        targets = sorted((index for index in seen if seen[index] >= LEAST_SEEN), key=lambda index: -seen[index])[
            :TARGETS
        ]
        if targets:
            notes = [
                *notes,
                f"The input views see less than {WELL_SEEN:.0%} of each held-out frame, so compare the scores over the seen pixels.",
            ]
    reason = prefix + _reason(scene, grids, context, bounds)
    return Choice(context, tuple(sorted(targets)), reason, bounds, tuple(notes))


def _covered(
    scene: Scene, grids: DepthGrids, context: Sequence[int], frames: Sequence[int], depth: float
) -> dict[int, float]:
    """The part of what each of some frames sees that the contexts see too, in the order of the frames."""
    every = list(dict.fromkeys((*context, *frames)))
    together = Covisibility(scene, every, grids.of(every, depth))
    parts = together.covered(range(len(context))).tolist()
    return dict(zip(every[len(context) :], parts[len(context) :], strict=True))


def _reason(scene: Scene, grids: DepthGrids, context: Sequence[int], bounds: DepthRange) -> str:
    """One sentence with the figures of the contexts."""
    found = grids.of(context, bounds.typical)
    together = Covisibility(scene, context, found)
    overlaps, baselines = together.overlaps(), together.baselines[np.triu_indices(len(context), 1)]
    np.fill_diagonal(overlaps, 0)
    shares = overlaps.max(axis=1)
    names = ", ".join(f"{index} ({scene.frames[index].name})" for index in context)
    unit = " m" if scene.unit == "metric" else ""
    share = _span(f"{shares.min():.0%}", f"{shares.max():.0%}") + " of what they see"
    if len(context) > 2:
        share = f"each {share} with another".replace("they see", "it sees")
    depth = float(np.median(together.medians))
    sources = " and ".join(dict.fromkeys(grid.source for grid in found if grid.source))
    kind = "middle" if bounds.median is None else "median"
    where = (
        f", by {sources} with a median of {depth:.2g}{unit},"
        if sources
        else f" at the {kind} depth of {depth:.2g}{unit}"
    )
    near, far = baselines.min(), baselines.max()
    relative = _span(f"{near / depth:.0%}", f"{far / depth:.0%}")
    apart = f"{_span(f'{near:.2g}', f'{far:.2g}')}{unit} ({relative} of it)"
    parallax = "" if far > 0.005 * depth else "; there is no parallax, so depth is a guess"
    return f"frames {names} share {share}{where} and are {apart} apart{parallax}"


def _span(least: str, most: str) -> str:
    """Two figures as a span, or as one where they read the same."""
    return least if least == most else f"{least} to {most}"
