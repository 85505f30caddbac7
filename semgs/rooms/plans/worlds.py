"""Plans of every style, and how much of them is from assets."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from semgs.rooms.assets.coverings import ALL, HUNG, Coverings
from semgs.rooms.assets.library import Library
from semgs.rooms.assets.swaps import Swaps
from semgs.rooms.assets.used import UsedAssets
from semgs.rooms.plans.floor_plan import FloorPlan
from semgs.rooms.plans.home import draw_home
from semgs.rooms.plans.other import draw_other
from semgs.rooms.plans.style import STYLES, Style

DRAWN = {"home": draw_home, "other": draw_other}
"""What makes the plans of each style."""
MESHES = {"home": 0.5, "other": 0.9}
"""Share of the rooms with meshes, where there is a library."""
PICTURES = {"home": 0.75, "other": 1.0}
"""Share of the rooms with pictures on their surfaces, where there is a library."""


def furnish(rng: np.random.Generator, library: Library | None, style: Style) -> tuple[FloorPlan, UsedAssets]:
    """A plan of a style and the pictures that its materials are of.

    What comes from the library is drawn by numbers of its own: furniture stands where it would without. Only the small
    things on it, and what is drawn after them, follow the tops of the meshes.

    Raises:
        ValueError: there is no such style.
        InputError: a file of the library cannot be read.
    """
    if style not in STYLES:
        raise ValueError(f"style {style!r}; expected one of {', '.join(STYLES)}")
    used = UsedAssets()
    if library is None:
        return DRAWN[style](rng), used
    own = rng.spawn(1)[0]
    has_meshes = own.random() < MESHES[style]
    coverings = Coverings(own, library, used, ALL if own.random() < PICTURES[style] else HUNG)
    swap = Swaps(own, library, coverings) if has_meshes else None
    plan = DRAWN[style](rng, swap)
    return replace(plan, parts=tuple(coverings.cover(plan.parts))), used
