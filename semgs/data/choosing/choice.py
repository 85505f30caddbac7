"""Choice of views: which frames become input views, which become target views, and why.

Frames are judged by what they see and from where, not by their position in the file. Two frames go well together if they see the
same things with a baseline of about a tenth of the depth: a shorter one shows no depth, a longer one leaves no matches. Close-ups count
less, because they show little of the scene. Depths come from depth maps or sparse points, if the scene has them (`semgs.data.choosing.covisibility`).
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from itertools import zip_longest

import numpy as np

from semgs.data.bounds.depth_range import DepthRange
from semgs.data.bounds.parallax import FrameFeatures
from semgs.data.choosing.covisibility import WIDEST_ANGLE, Covisibility, DepthGrids, flat_grid
from semgs.data.maps import DepthMap
from semgs.data.scene import Scene
from semgs.data.spread import spread
from semgs.files.errors import InputError
from semgs.files.text import listed
from semgs.runtime.notes import Kind

FEWER_VIEWS = Kind(
    "{chosen} input views instead of {wanted}: no other frame shares {share:.0%} of what it sees with them."
)
LITTLE_SEEN = Kind(
    "The input views see less than {share:.0%} of each held-out frame, so compare the scores over the seen pixels."
)

IDEAL_BASELINE = (0.05, 0.15)
"""Relative to the depth. The preference peaks at the geometric mean of the two."""

STEEPNESS = 0.72
"""Standard deviation of the preference, over the log of the baseline: 0.75 at the ends of the ideal band, 0.1 at 0.0185 and 0.406."""

LEAST_SHARED = 0.3
"""An input view has to share at least this much of what it sees with another one, in both directions."""

CLOSE_UP = 0.95
"""Pairs with a frame whose median depth is below this share of the scene's count less, by the square of the ratio, like the area that it sees."""

DRAWN_FROM = 40
"""Candidates for the other frames of a training sample."""

CANDIDATES = 300
"""If there are more frames, this many are considered, evenly spread: their neighbours show nearly the same."""

CANDIDATES_TO_READ = 100
"""The same if depth maps have to be read."""

TARGETS = 4
LEAST_SEEN = 0.5
"""A target view has to share at least this much of what it sees with the input views."""

WELL_SEEN = 0.9
"""Targets that share this much are preferred; otherwise scores mostly measure what no input view saw."""

MOSTLY_SEEN = 0.8
"""What a second target has to share, if there is only one that shares `WELL_SEEN`."""

GOOD_ENOUGH = 0.5
"""Input views that leave such a target are preferred to better ones that leave none, if their score is at least this share of the best."""

NAMED = 4
"""The reason names at most so many input views."""

TRIED = 1000
"""At most this many pairs are tried for such a target."""


@dataclass(frozen=True)
class Choice:
    """Which frames to use.

    Attributes:
        context: positions of the input views, ascending unless the user gave another order.
        targets: positions of the held-out views, ascending; may be empty.
        reason: why, one sentence.
        depth_range: near and far of the input views, used to choose targets and to reconstruct; for a training sample, those of its
            scene.
        notes: what the user should know about the choice.
        size: (height, width) of the frames as read [px], other aspect ratios cropped; None for `default_size` of the first one.
    """

    context: tuple[int, ...]
    targets: tuple[int, ...]
    reason: str
    depth_range: DepthRange
    notes: tuple[str, ...] = ()
    size: tuple[int, int] | None = None


def choose(scene: Scene, count: int) -> Choice:
    """The `count` frames that go best together as input views, and frames between them as targets.

    The first two are the pair with the most overlap and a baseline near 5 to 15 % of the depth, unless it shows little of the scene. Each further frame is the one that goes
    best with the nearest chosen frame, so views are added next to the others and show more. Frames that share less than `LEAST_SHARED` are
    never taken, so there may be fewer than `count`; a note says so.

    Raises:
        ValueError: `count` is less than 2 or more than there are usable frames.
        InputError: no two frames share that much.
    """
    _check_count(scene, count)
    features: dict[int, FrameFeatures] = {}
    typical = scene.depth_range(features=features).typical
    grids = DepthGrids(scene)
    few = spread(range(len(scene)), max(most_candidates(grids), count))
    together = Covisibility.of(scene, few, grids.of(few, typical))
    overlaps, baselines = together.overlaps(), together.baselines
    scores = pair_scores(together)
    each_once = np.where(np.tri(len(few), dtype=bool), -1, scores)

    def leaves_target(chosen: Sequence[int]) -> bool:
        """Whether the chosen frames cover another frame well."""
        shares = together.covered(chosen)
        shares[list(chosen)] = 0
        return bool(shares.max() >= WELL_SEEN)

    pair = _best(each_once.ravel(), lambda index: leaves_target(divmod(index, len(few))))
    if pair is None:
        raise nothing_shared(scene, few, together)
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
    notes: list[str] = []
    if len(context) < count:
        notes.append(FEWER_VIEWS(chosen=len(context), wanted=count, share=LEAST_SHARED))
    return _with_targets(scene, grids, context, scene.depth_range(context, features), "chosen: ", notes)


def pair_scores(together: Covisibility) -> np.ndarray:
    """How well each pair of frames goes together, 0..1; -1 for those that share too little, and for a frame with itself [n n]."""
    overlaps, medians = together.overlaps(), together.medians
    extent = np.minimum(np.minimum(medians[:, None], medians) / (CLOSE_UP * np.median(medians)), 1)
    suits = preference(together.relative_baselines) * extent**2
    scores = np.where(overlaps >= LEAST_SHARED, overlaps * suits, -1)
    np.fill_diagonal(scores, -1)
    return scores


def nothing_shared(scene: Scene, frames: Sequence[int], together: Covisibility) -> InputError:
    """The error for frames of which no two share enough."""
    overlaps = together.overlaps()
    np.fill_diagonal(overlaps, 0)
    return InputError(
        scene.path,
        f"two frames that share {LEAST_SHARED:.0%} of what they see",
        f"{overlaps.max():.0%} at most{_by_depth_maps(scene, frames, together.medians)}",
        advice="to use some anyway, name them (--context)",
    )


def choose_named(scene: Scene, context: Sequence[int | str]) -> Choice:
    """The input views that the user named, in that order, and frames between them as targets.

    Raises:
        ValueError: there are fewer than two, one appears twice, or the scene has no such frame.
    """
    indices = tuple(scene.index(frame) for frame in context)
    _check_count(scene, len(indices))
    if len(set(indices)) != len(indices):
        raise ValueError(f"the input views are {', '.join(map(str, context))}; expected different frames")
    return _with_targets(scene, DepthGrids(scene), indices, scene.depth_range(indices), "as requested: ")


def draw_sample(scene: Scene, bounds: DepthRange, contexts: int, targets: int, rng: np.random.Generator) -> Choice:
    """Random frames for training: input views that go together by the measure of `choose`, and targets between and around them.

    The first input view is any frame. Each further one is sampled by how well it goes with the nearest of the others. Targets are sampled
    from the frames that share enough of what they see with an input view.

    Args:
        scene: the scene.
        bounds: near and far of the scene.
        contexts: number of input views.
        targets: number of target views.
        rng: random numbers; the same state gives the same frames.

    Raises:
        InputError: the scene has fewer frames than that.
    """
    _check_frames(scene, contexts + targets, f"for {contexts} input views and {targets} to compare with")
    first = int(rng.integers(len(scene)))
    few = np.array([first, *_beside(scene, first, bounds, max(DRAWN_FROM, contexts + targets), rng)])
    together = Covisibility.of(scene, few, [flat_grid(bounds.middle)] * len(few))
    overlaps, baselines = together.overlaps(), together.baselines
    scores = overlaps * preference(baselines / bounds.middle)
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


def draw_consecutive(scene: Scene, bounds: DepthRange, contexts: int, targets: int, rng: np.random.Generator) -> Choice:
    """Random frames for training, arranged as in the protocol `neighbours`: a target, the input views around it, more targets beside them.

    The first target is any inner frame. Its input views are the nearest frames in file order, and further targets the next nearest.

    Args:
        scene: the scene.
        bounds: near and far of the scene.
        contexts: number of input views.
        targets: number of target views, at least 1.
        rng: random numbers; the same state gives the same frames.

    Raises:
        InputError: the scene has fewer frames than that, or fewer than three.
    """
    _check_frames(scene, max(contexts + targets, 3), f"for {contexts} input views around one to compare with")
    target = int(rng.integers(1, len(scene) - 1))
    forward = bool(rng.integers(2))
    order = frames_around(target, len(scene), contexts + targets - 1, forward)
    return Choice(tuple(sorted(order[:contexts])), tuple(sorted((target, *order[contexts:]))), "consecutive", bounds)


def frames_around(frame: int, frames: int, count: int, forward: bool = False) -> tuple[int, ...]:
    """The `count` frames nearest to one in file order, alternately before and after it; if one side ends, the rest comes from the other.

    Args:
        frame: the position of that frame.
        frames: how many there are.
        count: how many to return.
        forward: start after it.
    """
    sides = [range(frame - 1, -1, -1), range(frame + 1, frames)]
    turns = zip_longest(*(reversed(sides) if forward else sides))
    return tuple([other for pair in turns for other in pair if other is not None][:count])


def _beside(scene: Scene, first: int, bounds: DepthRange, count: int, rng: np.random.Generator) -> np.ndarray:
    """Candidates to go with a frame: frames not too far away that look a similar way, then the nearest."""
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
    """An index sampled in proportion to `fit`, excluding those taken; if nothing fits, the one with the largest value in `otherwise`."""
    fit, otherwise = fit.copy(), otherwise.copy()
    fit[list(taken)], otherwise[list(taken)] = 0, -1
    total = fit.sum()
    return int(rng.choice(len(fit), p=fit / total)) if total > 0 else int(np.argmax(otherwise))


def _by_depth_maps(scene: Scene, few: Sequence[int], medians: np.ndarray) -> str:
    """What depth maps said, and in which unit, if frames have some: if that is wrong, nothing seems to be shared."""
    units = {one.unit for index in few if isinstance(one := scene.frames[index].depth, DepthMap)}
    if not units:
        return ""
    unit = " m" if scene.unit == "metric" else ""
    return (
        f" by their depth maps, whose median is {np.median(medians):.2g}{unit} if they count in {listed([f'{one:.3g}' for one in sorted(units)])} m "
        "(if they count in another unit, give it: --depth-unit)"
    )


def _check_count(scene: Scene, count: int) -> None:
    """Refuse fewer than two input views, or more than there are usable frames."""
    if not 2 <= count <= len(scene):
        raise ValueError(
            f"{count} input view{'' if count == 1 else 's'} requested; expected 2 to {len(scene)}, the number of usable frames of {scene.path}"
        )


def _check_frames(scene: Scene, count: int, purpose: str) -> None:
    """Refuse a scene with fewer usable frames."""
    if count > len(scene):
        raise InputError(scene.path, f"at least {count} usable frames, {purpose}", f"{len(scene)}")


def preference(relative: np.ndarray) -> np.ndarray:
    """How good a baseline relative to the depth is: 1 in the middle of the ideal band, towards 0 far from it."""
    best = (IDEAL_BASELINE[0] * IDEAL_BASELINE[1]) ** 0.5
    return np.exp(-0.5 * (np.log(np.maximum(relative, 1e-9) / best) / STEEPNESS) ** 2)


def _best(fit: np.ndarray, leaves_target: Callable[[int], bool]) -> int | None:
    """The best allowed index (fit 0 or more), or rather the best `GOOD_ENOUGH` one that leaves a target; None if none is allowed."""
    order = np.argsort(-fit, kind="stable")[:TRIED].tolist()
    good = [index for index in order if fit[index] >= max(GOOD_ENOUGH * fit[order[0]], 0)]
    return next((index for index in good if leaves_target(index)), good[0] if good else None)


def most_candidates(grids: DepthGrids) -> int:
    """How many frames are considered."""
    return CANDIDATES_TO_READ if grids.measured else CANDIDATES


def _with_targets(
    scene: Scene,
    grids: DepthGrids,
    context: tuple[int, ...],
    bounds: DepthRange,
    prefix: str,
    notes: Sequence[str] = (),
) -> Choice:
    """The choice with these input views: its targets and its reason.

    Targets are up to `TARGETS` frames of which the input views see `WELL_SEEN`, no farther from one of them than the input views are from each other: evenly
    spread between the input views in file order, or else the nearest others. A walk that comes back has such frames in another part, too, and they show other things.
    If there are none, the near frames that are seen best are taken, and a note says so; else one that is farther away. One alone gets a second one up to twice as far
    away, of which they see `MOSTLY_SEEN`.
    """
    between = [index for index in range(min(context) + 1, max(context)) if index not in context]
    others = [index for index in range(len(scene)) if index not in context]
    centres = np.stack([frame.world_from_camera[:3, 3] for frame in scene.frames])
    distance = np.linalg.norm(centres[:, None] - centres[list(context)], axis=-1).min(axis=1)
    nearest = sorted(others, key=lambda index: (distance[index], index))[: 4 * TARGETS]
    seen = covered(scene, grids, context, [*spread(between, most_candidates(grids)), *nearest], bounds.typical)
    well = sorted((index for index in seen if seen[index] >= WELL_SEEN), key=lambda index: (distance[index], index))
    reach = _reach(centres[list(context)])
    near = [index for index in well if distance[index] <= reach]
    enough = [index for index in seen if seen[index] >= LEAST_SEEN and distance[index] <= reach]
    enough = sorted(enough, key=lambda index: -seen[index])
    targets = spread(sorted(index for index in near if index in between), TARGETS) or near[:TARGETS] or enough[:TARGETS]
    targets = targets or well[:1]
    if len(targets) == 1:  # one may decide when refining stops, and another one test the result
        mostly = [index for index in seen if seen[index] >= MOSTLY_SEEN and distance[index] <= 2 * reach]
        targets += sorted(set(mostly) - set(targets), key=lambda index: (distance[index], index))[:1]
    if targets and max(seen[index] for index in targets) < WELL_SEEN:
        notes = [*notes, LITTLE_SEEN(share=WELL_SEEN)]
    reason = prefix + reason_of(scene, grids, context, bounds)
    return Choice(context, tuple(sorted(targets)), reason, bounds, tuple(notes))


def _reach(centres: np.ndarray) -> float:
    """How far the input view is from its nearest other one that is farthest from it, with room for rounding."""
    apart = np.linalg.norm(centres[:, None] - centres, axis=-1)
    np.fill_diagonal(apart, np.inf)
    return 1.001 * float(apart.min(axis=1).max())


def covered(
    scene: Scene, grids: DepthGrids, context: Sequence[int], frames: Sequence[int], depth: float
) -> dict[int, float]:
    """For some frames, the share of what they see that the input views also see."""
    every = list(dict.fromkeys((*context, *frames)))
    together = Covisibility.of(scene, every, grids.of(every, depth))
    parts = together.covered(range(len(context))).tolist()
    return dict(zip(every[len(context) :], parts[len(context) :], strict=True))


def reason_of(scene: Scene, grids: DepthGrids, context: Sequence[int], bounds: DepthRange) -> str:
    """One sentence with the figures of the input views."""
    found = grids.of(context, bounds.typical)
    together = Covisibility.of(scene, context, found)
    overlaps, baselines = together.overlaps(), together.baselines[np.triu_indices(len(context), 1)]
    np.fill_diagonal(overlaps, 0)
    shares = overlaps.max(axis=1)
    names = "frames " + ", ".join(f"{index} ({scene.frames[index].name})" for index in context)
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
    return f"{names if len(context) <= NAMED else 'they'} share {share}{where} and are {apart} apart{parallax}"


def _span(least: str, most: str) -> str:
    """Two figures as a span, or one if they are the same."""
    return least if least == most else f"{least} to {most}"
