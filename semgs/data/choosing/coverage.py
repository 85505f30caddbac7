"""Choice of all frames that add something: input views for a whole room.

A window has three views. So a frame adds those parts of what it sees that fewer than three of the chosen frames see. A few photos are all used, unless one was taken
from the place of another: each makes depth and colours better.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence

import numpy as np

from semgs.data.bounds.depth_range import DepthRange
from semgs.data.bounds.parallax import FrameFeatures
from semgs.data.choosing.choice import (
    LEAST_SEEN,
    LEAST_SHARED,
    Choice,
    covered,
    most_candidates,
    nothing_shared,
    pair_scores,
    reason_of,
)
from semgs.data.choosing.covisibility import Covisibility, DepthGrids
from semgs.data.scene import Scene
from semgs.data.spread import spread
from semgs.files.errors import InputError
from semgs.files.text import counted, listed
from semgs.runtime.notes import Kind, Note

LEAST_ADDED = 0.02
"""A frame is used if it adds at least this share of what it sees."""

TIMES = 3
"""So many of the chosen frames should see each surface."""

A_FEW = 12
"""Up to so many frames are used even if more than `TIMES` frames see all of it."""

FAR = 0.3
"""Photos are far apart if most stand more than this share of the depth from the nearest other one."""

SAME_PLACE, SAME_VIEW = 0.002, 0.95
"""A frame adds nothing if it is closer than this share of the depth to a chosen one and shares so much with it."""

EVERY = 8
"""One of so many frames is held out."""

FEWEST = 4
"""Of fewer frames, none is held out."""

MOST_HELD_OUT = 8
"""Of a long recording, at most so many frames are held out."""

NAMED = 3
"""A note names at most so many frames."""

NOT_USABLE = Kind("Left out: {frames} ({why}).", "Left out, because they cannot be used: {frames}.")
SHARE_TOO_LITTLE = Kind(
    "Left out: {frames}. No input view shares {share:.0%} of what they see.",
    "Left out, because they share too little with the others: {frames}.",
)
SHOW_THE_SAME = Kind("Not needed, because the input views show the same: {frames}.")
TOO_MANY = Kind(
    "Left out, although they add something: {frames}. By default, at most {most} input views are used; --all uses every frame that adds something.",
    "Left out, because {most} photos are the most that are used: {frames}.",
)

FAR_APART = Kind(
    "The photos are far apart: {far} of {count} stand more than {share:.0%} of the distance to what they show from the next, so their depth is "
    "uncertain. Photos a tenth of it apart give the best results."
)


def choose_covering(
    scene: Scene, most: int | None, why_not: Callable[[int, DepthRange], str | None] = lambda position, bounds: None
) -> Choice:
    """All frames that add something as input views, and one of `EVERY` held out.

    The first two are the pair that goes best together, as in `semgs.data.choosing.choice`. Next comes the frame that adds most, of those that share
    `LEAST_SHARED` of what they see with a chosen one, until none adds `LEAST_ADDED`. Then another pair begins that shares too little with the chosen ones, if there is one.

    Args:
        scene: the scene.
        most: input views at most; None for as many as it takes.
        why_not: says why the frame at a position cannot be used, given near and far of the scene; None if it can. It reads a frame only if that would be used.

    Raises:
        InputError: no two usable frames share enough.
    """
    features: dict[int, FrameFeatures] = {}
    of_all = scene.depth_range(features=features)
    grids = DepthGrids(scene)
    few = spread(range(len(scene)), most_candidates(grids))
    broken: dict[int, str] = {}

    def usable(position: int) -> bool:
        """Whether a frame can be used; why not is kept."""
        if position not in broken and (reason := why_not(position, of_all)) is not None:
            broken[position] = reason
        return position not in broken

    held = [position for position in _every_eighth(few) if usable(position)]
    rest = [position for position in few if position not in held]
    together = Covisibility.of(scene, rest, grids.of(rest, of_all.typical))
    overlaps, pairs = together.overlaps(), _pairs(together)
    chosen = _first(pairs, lambda place: usable(rest[place]))
    if not chosen:
        if broken and len(rest) - len(broken) < 2:
            found = f"none: {next(iter(broken.values()))}"
            raise InputError(scene.path, "at least two usable frames that overlap", found)
        raise nothing_shared(scene, rest, together)
    times, repeats = TIMES, _repeats(together, overlaps)
    while True:
        used = [place for place, position in enumerate(rest) if place in chosen or position in broken]
        added = 1 - together.covered(chosen, times if len(chosen) < A_FEW else TIMES)
        added[[*used, *np.flatnonzero(repeats[:, chosen].any(axis=1))]] = 0
        linked = np.where((overlaps[:, chosen] >= LEAST_SHARED).any(axis=1), added, 0)
        best = int(linked.argmax())
        if len(chosen) == most:
            break
        if linked[best] >= LEAST_ADDED:
            chosen += [best] * usable(rest[best])
            continue
        room = len(rest) if most is None else most - len(chosen)
        new = set(np.flatnonzero(added >= LEAST_ADDED).tolist()) if room > 1 else set()
        pair = _first(pairs, lambda place, new=new: place in new and usable(rest[place]))  # type: ignore[misc]
        if not pair and (len(chosen) >= A_FEW or times > len(chosen)):
            break
        chosen += pair
        times += not pair
    context = tuple(sorted(rest[place] for place in chosen))
    bounds = scene.depth_range(context, features)
    others = [place for place in range(len(rest)) if place not in chosen and rest[place] not in broken]
    apart = [rest[place] for place in others if overlaps[place, chosen].max() < LEAST_SHARED]
    more = [rest[place] for place in others if added[place] >= LEAST_ADDED and rest[place] not in apart]
    same = [rest[place] for place in others if rest[place] not in (*apart, *more)]
    seen = covered(scene, grids, context, held, bounds.typical)
    names = [scene.frames[position].name for position in range(len(scene))]
    notes: list[Note] = [NOT_USABLE(frames=names[position], why=why) for position, why in broken.items()][:NAMED]
    notes += [SHARE_TOO_LITTLE(frames=_named(apart, names), share=LEAST_SHARED)] * bool(apart)
    notes += [SHOW_THE_SAME(frames=_named(same, names))] * bool(same)
    notes += [TOO_MANY(frames=_named(more, names), most=most)] * bool(more)
    notes += far_apart(together, chosen)
    targets = tuple(position for position in held if seen[position] >= LEAST_SEEN)
    reason = f"{len(context)} of {counted(len(scene), 'frame')} add something: " * (len(context) > 2)
    return Choice(context, targets, reason + reason_of(scene, grids, context, bounds), bounds, tuple(notes))


def far_apart(together: Covisibility, chosen: Sequence[int]) -> list[Note]:
    """A note if most of the chosen frames are farther from the nearest other one than `FAR` of the depth."""
    apart = together.relative_baselines[np.ix_(chosen, chosen)]
    np.fill_diagonal(apart, np.inf)
    far = int((apart.min(axis=1) > FAR).sum())
    return [FAR_APART(far=far, count=len(chosen), share=FAR)] * (2 * far > len(chosen))


def windows_of(scene: Scene, frames: Sequence[int], typical: float) -> list[tuple[int, ...]]:
    """For each of some frames its window: its place among them and those of the two that go best with it, ascending.

    Args:
        scene: contains the frames.
        frames: their positions.
        typical: the depth of frames without any [m, or the scene's unit].
    """
    together = Covisibility.of(scene, frames, DepthGrids(scene).of(frames, typical))
    scores, nearest = pair_scores(together), -together.baselines
    np.fill_diagonal(nearest, -np.inf)
    best = np.lexsort((nearest, scores))[:, ::-1][:, : TIMES - 1]
    return [tuple(sorted((place, *map(int, others)))) for place, others in enumerate(best)]


def _every_eighth(few: Sequence[int]) -> list[int]:
    """The frames that are held out, evenly spread; none of very few."""
    count = min(-(-len(few) // EVERY), MOST_HELD_OUT) if len(few) >= FEWEST else 0
    return [few[(2 * place + 1) * len(few) // (2 * count)] for place in range(count)]


def _repeats(together: Covisibility, overlaps: np.ndarray) -> np.ndarray:
    """Which frames were taken from the place of which others, and show the same [n n]."""
    return (together.relative_baselines < SAME_PLACE) & (overlaps >= SAME_VIEW)


def _pairs(together: Covisibility) -> list[list[int]]:
    """The places of each two frames that share enough, those that go together best first."""
    scores = pair_scores(together)
    scores[np.tri(len(scores), dtype=bool)] = -1
    order = np.argsort(-scores, axis=None, kind="stable")[: int((scores >= 0).sum())]
    return [list(divmod(index, len(scores))) for index in order.tolist()]


def _first(pairs: Sequence[list[int]], usable: Callable[[int], bool]) -> list[int]:
    """The first pair of which both can be used; none if there is none."""
    return next((pair for pair in pairs if all(usable(place) for place in pair)), [])


def _named(positions: Sequence[int], names: Sequence[str]) -> str:
    """Some frames, by name."""
    return listed([names[position] for position in positions], NAMED)
