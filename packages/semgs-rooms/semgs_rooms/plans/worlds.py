"""Floor plans of every style, and how many of them use assets."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from semgs_rooms.assets.asset_library import Library
from semgs_rooms.assets.coverings import ALL, HUNG, Coverings
from semgs_rooms.assets.swaps import Swaps
from semgs_rooms.assets.used import UsedAssets
from semgs_rooms.plans.closeup import draw_closeup, recolour
from semgs_rooms.plans.floor_plan import FloorPlan
from semgs_rooms.plans.home import draw_home
from semgs_rooms.plans.other import draw_other
from semgs_rooms.plans.style import STYLES, Style

PLANNERS = {"home": draw_home, "other": draw_other, "closeup": draw_closeup}
MESHES = {"home": 0.5, "other": 0.9, "closeup": 0.4}
"""If there is a library: share of rooms that use its meshes."""
IMAGES = {"home": 0.75, "other": 1.0, "closeup": 0.6}
"""If there is a library: share of rooms that use its images on all surfaces."""


def furnish(rng: np.random.Generator, library: Library | None, style: Style) -> tuple[FloorPlan, UsedAssets]:
    """A floor plan of a style, and the assets that it uses.

    Assets are chosen with a random generator of their own, so furniture is where it would be without a library. Only small things
    on furniture, and whatever is placed after them, depend on the tops of the meshes.

    Raises:
        ValueError: there is no such style.
        InputError: a file of the library cannot be read.
    """
    if style not in STYLES:
        raise ValueError(f"style {style!r}; expected one of {', '.join(STYLES)}")
    used = UsedAssets()
    if library is None:
        plan = PLANNERS[style](rng)
    else:
        own = rng.spawn(1)[0]
        has_meshes = own.random() < MESHES[style]
        coverings = Coverings(own, library, used, ALL if own.random() < IMAGES[style] else HUNG)
        plan = PLANNERS[style](rng, Swaps(own, library, coverings) if has_meshes else None)
        plan = replace(plan, parts=tuple(coverings.cover(plan.parts)))
    return recolour(rng, plan) if style == "closeup" else plan, used
