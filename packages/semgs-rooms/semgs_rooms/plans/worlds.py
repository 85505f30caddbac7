"""Floor plans of every style, and how many of them use assets.

The style `closeup` is here: homes in which one piece fills the image, in colours that photos show often and `home` rarely. See `docs/rooms.md`.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from semgs_rooms.assets.asset_library import Library
from semgs_rooms.assets.coverings import ALL, HUNG, Coverings, UsedAssets
from semgs_rooms.assets.swaps import Swaps
from semgs_rooms.pieces import cloth, fittings
from semgs_rooms.pieces import materials as m
from semgs_rooms.pieces import texture_kernels as t
from semgs_rooms.pieces.furniture import LABEL
from semgs_rooms.pieces.materials import Colour, Material
from semgs_rooms.pieces.solids import Solid
from semgs_rooms.plans.builder import Swap
from semgs_rooms.plans.floor_plan import FloorPlan
from semgs_rooms.plans.home import Household, draw_home
from semgs_rooms.plans.other import draw_other
from semgs_rooms.plans.style import STYLES, Style

HOUSEHOLD = Household(
    shares={"bedroom": 0.28, "kitchen": 0.32, "bathroom": 0.28, "living": 0.12},
    two_rooms=0.0,
    wardrobe=lambda rng: (cloth.canvas_wardrobe if rng.random() < 0.6 else fittings.cabinet)(rng),
    wide_curtains=0.5,
)

RECOLOURED = tuple(LABEL[name] for name in ("cabinet", "bed", "counter", "refrigerator", "curtain", "shower curtain"))
"""Classes of which many materials get another colour."""
SHARE = 0.6
"""Share of their materials that do."""
WHITE = tuple(LABEL[name] for name in ("wall", "bathtub", "toilet", "sink", "shower curtain", "cabinet"))
"""Classes that are white in a white bathroom."""
WHITE_BATHROOMS = 0.4
"""Share of bathrooms that are white."""
CONTRAST = (0.4, 2.5)
"""Range of the ratio between two colours of a pattern."""
PATTERNS = (t.PLAIN, t.STRIPES, t.CHECKER, t.WOOD, t.PLANKS, t.WEAVE, t.DOTS, t.MARBLE, t.TILES)
COLOURS = tuple(slice(start, start + 3) for start in (t.COLOUR_A, t.COLOUR_B, t.COLOUR_C))


def draw_closeup(rng: np.random.Generator, swap: Swap | None = None) -> FloorPlan:
    """A random room: a home with more kitchens and bathrooms, canvas wardrobes, and curtains along whole walls.

    `swap` may replace each piece with another of the same footprint.
    """
    return draw_home(rng, swap, HOUSEHOLD)


def recolour(rng: np.random.Generator, plan: FloorPlan) -> FloorPlan:
    """The plan with other colours: many materials of large pieces are dark, strong or pale, and some bathrooms are white."""
    white = plan.kind == "bathroom" and rng.random() < WHITE_BATHROOMS
    known: dict[bytes, Material] = {}

    def coloured(part: Solid) -> Solid:
        material, key = part.material, part.material.tobytes() + bytes([part.label])
        if key not in known:
            if white and part.label in WHITE:
                known[key] = _with_colour(material, m.colour(rng, (0.05, 0.2), (0.0, 0.06), (0.8, 0.97)))
            elif part.label in RECOLOURED and rng.random() < SHARE:
                known[key] = _with_colour(material, _draw_colour(rng))
            else:
                known[key] = material
        return replace(part, material=known[key])

    return replace(plan, parts=tuple(coloured(part) for part in plan.parts))


def _draw_colour(rng: np.random.Generator) -> Colour:
    """Dark, red, strong or pale."""
    look = rng.random()
    if look < 0.4:
        return m.colour(rng, saturation=(0.0, 0.6), value=(0.04, 0.3))
    if look < 0.6:
        return m.colour(rng, (-0.04, 0.03), (0.6, 1.0), (0.25, 0.75))
    if look < 0.8:
        return m.colour(rng, saturation=(0.4, 0.9), value=(0.3, 0.9))
    return m.colour(rng, saturation=(0.0, 0.1), value=(0.75, 0.97))


def _with_colour(material: Material, base: Colour) -> Material:
    """A material whose first colour is this one; a pattern keeps its contrast, and an image its structure."""
    kind, changed = int(material[t.KIND]), material.copy()
    if kind == t.PICTURE:
        changed[COLOURS[0]] = _brightness(material[COLOURS[0]]) * np.array(base)
    elif kind in PATTERNS:
        for place in COLOURS:
            ratio = np.clip(_brightness(material[place]) / _brightness(material[COLOURS[0]]), *CONTRAST)
            changed[place] = np.minimum(ratio * np.array(base), 0.95)
    return changed


def _brightness(colour: Sequence[float] | np.ndarray) -> float:
    """The mean of a colour, at least 0.01."""
    return max(float(np.mean(colour)), 0.01)


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
