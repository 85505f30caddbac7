"""The style `closeup`: one piece fills the image, in colours that homes rarely have; everything else is as in homes."""

from dataclasses import replace

import numpy as np
import pytest

pytest.importorskip("embreex")

from semgs_rooms.drawing.room import build_room
from semgs_rooms.pieces import materials as m
from semgs_rooms.pieces import texture_kernels as t
from semgs_rooms.pieces.furniture import LABEL
from semgs_rooms.pieces.solids import block
from semgs_rooms.plans import dressing, outlines, worlds
from semgs_rooms.plans.builder import Builder
from semgs_rooms.plans.floor_plan import FloorPlan
from semgs_rooms.plans.worlds import draw_closeup, recolour
from semgs_rooms.sets.carried_cameras import LARGE_SUBJECTS
from semgs_rooms.sets.room_stream import sample

RED = (0.5, 0.1, 0.15)


def largest_share(style: str, index: int) -> float:
    """How much of a view the class of large furniture that shows most fills."""
    labels = sample(4, index, size=(24, 32), contexts=1, targets=0, style=style)[0].labels
    assert labels is not None
    return max(float((labels == label).float().mean()) for label in LARGE_SUBJECTS)


def test_in_most_views_one_piece_fills_more_than_half_of_the_image_which_is_rare_in_homes():
    close, home = (np.array([largest_share(style, index) for index in range(16)]) for style in ("closeup", "home"))
    assert np.median(close) > 0.5
    assert np.median(home) < 0.3


def test_a_pattern_keeps_its_contrast_and_an_image_its_structure_in_another_colour():
    """Stripes of brightness 0.4 and 0.2 become red and half as red; an image at 0.6 of its own brightness is multiplied by 0.6 of red."""
    rng = np.random.default_rng(0)
    stripes = m.patterned(rng, m.Pattern(t.STRIPES, (0.5, 0.4, 0.3), (0.1, 0.2, 0.3)))
    changed = worlds._with_colour(stripes, RED)
    assert changed[t.COLOUR_A : t.COLOUR_A + 3] == pytest.approx(RED)
    assert changed[t.COLOUR_B : t.COLOUR_B + 3] == pytest.approx((0.25, 0.05, 0.075))
    picture = m.patterned(rng, m.Pattern(t.PICTURE, (0.6, 0.6, 0.6)))
    assert worlds._with_colour(picture, RED)[t.COLOUR_A : t.COLOUR_A + 3] == pytest.approx((0.3, 0.06, 0.09))
    shelf = m.books(rng)
    assert np.array_equal(worlds._with_colour(shelf, RED), shelf), "books stay colourful"


def plan_of(kind: str, names: list[str]) -> FloorPlan:
    rng = np.random.default_rng(7)
    parts = tuple(block(LABEL[name], m.plain(rng, (0.2, 0.4, 0.6)), (0, 0, 0), (1, 1, 1)) for name in names)
    return FloorPlan(kind, (4.0, 3.0, 2.5), parts, (), (), (), ())


def test_six_in_ten_materials_of_large_pieces_change_and_none_of_others():
    rng = np.random.default_rng(3)
    large = recolour(rng, plan_of("kitchen", ["cabinet"] * 400)).parts
    changed = np.array([part.material[t.COLOUR_A] != 0.2 for part in large])
    assert changed.mean() == pytest.approx(0.6, abs=0.08)
    before = plan_of("kitchen", ["sofa", "table", "floor", "wall", "sink"])
    assert recolour(rng, before) == before


def test_a_white_bathroom_is_white_and_parts_of_one_material_stay_alike():
    plan = plan_of("bathroom", ["wall", "bathtub"])
    plan = replace(plan, parts=(*plan.parts, replace(plan.parts[1], centre=(2.0, 0.0, 0.0))))
    white = 0
    for seed in range(200):
        wall, tub, rim = (part.material[t.COLOUR_A : t.COLOUR_A + 3] for part in recolour(np.random.default_rng(seed), plan).parts)  # fmt: skip
        assert np.array_equal(tub, rim)
        white += min(*wall, *tub) > 0.55  # linear: the darkest white has a value of 0.8 in sRGB, 0.604
    assert white / 200 == pytest.approx(0.4, abs=0.08)


def test_a_curtain_covers_at_least_seven_tenths_of_a_free_wall():
    for seed in range(20):
        builder = Builder(np.random.default_rng(seed), outlines.rectangular("living", (5.0, 4.0, 2.5)))
        (zone,) = builder.outline.zones
        dressing.hang_wide_curtain(builder, zone)
        (wall,) = [wall for wall in zone.walls if wall.taken]
        left, right, low, high = wall.taken[0]
        assert right - left >= 0.7 * (wall.length - 0.08) - 1e-9
        assert (low, 2.3 <= high < 2.5) == (0.0, True)
        assert {part.label for part in builder.parts} == {LABEL["curtain"]}


def test_a_wall_with_something_on_it_everywhere_gets_no_curtain():
    builder = Builder(np.random.default_rng(0), outlines.rectangular("living", (5.0, 4.0, 2.5)))
    (zone,) = builder.outline.zones
    for wall in zone.walls:
        wall.taken.append((0.0, wall.length, 1.0, 1.5))
    dressing.hang_wide_curtain(builder, zone)
    assert builder.parts == []


def test_rooms_are_those_of_the_household_and_colours_move_nothing():
    plans = [draw_closeup(np.random.default_rng(seed)) for seed in range(24)]
    assert {plan.kind for plan in plans} == {"bedroom", "kitchen", "bathroom", "living"}
    for seed, plan in enumerate(plans[:6]):
        coloured = recolour(np.random.default_rng(seed), plan)
        assert [(part.label, part.centre, part.size) for part in coloured.parts] == [
            (part.label, part.centre, part.size) for part in plan.parts
        ]
    assert build_room(np.random.default_rng(1), style="closeup").plan.kind in {plan.kind for plan in plans}
