"""Refines the Gaussians on the photos, and finds the photo that decides when to stop."""

from __future__ import annotations

from dataclasses import dataclass, replace

from semgs.data.choosing.choice import Choice
from semgs.data.scene import Scene
from semgs.data.views import Views, joined
from semgs.run.steps.result import Draft, Refining
from semgs.runtime.notes import Kind
from semgs.runtime.stopwatch import Stages
from semgs.scene.photo_refinement import Refined, refine_until

REFINING = Kind("Refining {gaussians:,} Gaussians in {count} steps", "Sharpening {gaussians:,} Gaussians")

FEW_PHOTOS = 5
"""Of so many photos, none is only there to decide when refining stops."""


@dataclass(frozen=True)
class Decider:
    """The photo that decides when refining stops.

    Attributes:
        name: of its frame.
        view: as read.
        others: the photos that teach while it decides.
        every: those that teach afterwards, with it among them; None if it is held out to the end.
    """

    name: str
    view: Views
    others: Views
    every: Views | None = None


def find_decider(
    scene: Scene, choice: Choice, context: Views, target: Views | None
) -> tuple[Decider | None, Choice, Views | None]:
    """The photo that decides when refining stops; and the choice and the held-out views without it.

    It is the first held-out one. Without any, it is one of three or more input photos, the middle one. Of two photos, none decides. Of a few photos, none is spared: it takes
    part afterwards.
    """
    if target is None:
        if len(context) < 3:
            return None, choice, None
        middle = len(context) // 2
        others = context.select([view for view in range(len(context)) if view != middle])
        name = scene.frames[choice.context[middle]].name
        return Decider(name, context.select([middle]), others, context), choice, None
    rest = target.select(range(1, len(target))) if len(target) > 1 else None
    view = target.select([0])
    every = joined([context, view]) if len(scene) <= FEW_PHOTOS else None
    decider = Decider(scene.frames[choice.targets[0]].name, view, context, every)
    return decider, replace(choice, targets=choice.targets[1:]), rest


def refine(draft: Draft, passes: int, moves: bool, stages: Stages) -> Draft:
    """The draft with its Gaussians refined on the photos. A photo that takes part afterwards decides in half the passes, over the others; then all photos teach.

    Args:
        draft: with encoded views.
        passes: steps for each photo; 0 changes nothing.
        moves: whether Gaussians may move along their rays.
        stages: shows and times the stage sharpen.
    """
    if not passes:
        return draft
    decider, choice, target = find_decider(draft.scene, draft.choice, draft.context, draft.target)
    check, taught = (None, False) if decider is None else (decider.name, decider.every is not None)
    done = _refined(draft, passes, decider, moves, stages)
    refining = Refining(passes, done, draft.encoding, check, taught)
    return replace(draft, choice=choice, target=target, encoding=done.encoding, refining=refining)


def _refined(draft: Draft, passes: int, decider: Decider | None, moves: bool, stages: Stages) -> Refined:
    """The refined Gaussians."""
    encoding, context = draft.encoding, draft.context
    trial, every = 0, context if decider is None else decider.every
    if decider is not None:
        trial = (passes + 1) // 2 if every is not None else passes
    count = passes * (0 if every is None else len(every)) + trial * (0 if decider is None else len(decider.others))

    def run(length: int, photos: Views, before: int, check: Views | None = None) -> Refined:
        return refine_until(
            encoding,
            context,
            length,
            check=check,
            moves=moves,
            photos=photos,
            done=lambda steps: done(before + steps),
        )

    with stages.steps("sharpen", REFINING(gaussians=len(encoding.gaussians), count=count), count) as done:
        if decider is None:
            return run(passes, context, 0)
        tried = run(trial, decider.others, 0, decider.view)
        if every is None or tried.passes == 0:
            return tried
        return replace(run(round(passes * tried.passes / trial), every, trial * len(decider.others)), curve=tried.curve)
