from itertools import pairwise

import numpy as np
import pytest

pytest.importorskip("embreex")

from standing import Standing

from semgs.data.tables.classes import IGNORE
from semgs_rooms.pieces import kitchen_and_bath
from semgs_rooms.pieces.furniture import LABEL
from semgs_rooms.pieces.solids import gather
from semgs_rooms.pieces.texture_kernels import COLOUR_A
from semgs_rooms.plans.builder import snug

TOWARDS_THE_BACK, DOWN = (0, -1, 0), (0, 0, -1)


def forty(maker):
    return [snug(maker(np.random.default_rng(seed))) for seed in range(40)]


def test_refrigerators_are_small_to_wide_and_black_to_white():
    fridges = forty(kitchen_and_bath.home_refrigerator)
    widths, depths, heights = np.array([piece.size for piece in fridges]).T
    assert 0.45 <= widths.min() < 0.56
    assert 0.8 < widths.max() <= 0.96
    assert 0.8 <= heights.min() < 0.9
    assert 1.8 < heights.max() <= 2.0
    assert depths.min() >= 0.6
    assert depths.max() <= 0.72 + 0.08 + 0.05  # body, door, handle
    doors = [max(piece.parts[3:], key=lambda part: part.size[0] * part.size[2]) for piece in fridges]
    light = np.array([door.material[COLOUR_A : COLOUR_A + 3].mean() for door in doors])
    assert (light < 0.02).sum() >= 4  # black: 0.14 in sRGB is 0.017
    assert (light > 0.64).sum() >= 6  # white: 0.82 is 0.64
    assert ((light > 0.14) & (light < 0.6)).sum() >= 6  # steel: 0.42 is 0.15
    assert {label for piece in fridges for label in gather(piece.parts).labels.tolist()} == {LABEL["refrigerator"]}


def test_doors_of_a_refrigerator_have_gaps_of_4_mm():
    """The widest doors above each other leave 4 mm between the lower and the upper one."""
    gaps = []
    for piece in forty(kitchen_and_bath.home_refrigerator):
        doors = [part for part in piece.parts[3:] if part.size[0] > 0.7 * piece.size[0]]
        for lower, upper in pairwise(doors):
            gaps.append(upper.centre[2] - upper.size[2] / 2 - lower.centre[2] - lower.size[2] / 2)
    assert len(gaps) > 10
    assert np.median(gaps) == pytest.approx(0.004)


def test_a_robot_that_passes_an_island_at_40_cm_height_sees_a_counter():
    for piece in forty(kitchen_and_bath.home_island):
        width, depth, _ = piece.size
        label, distance = Standing(piece).hit((width / 2, depth + 0.5, 0.4), TOWARDS_THE_BACK)
        assert label == LABEL["counter"]
        assert 0.49 < distance < 0.65
        assert 0.85 < piece.surface < 0.97
        assert set(gather(piece.parts).labels.tolist()) <= {LABEL["counter"], LABEL["sink"], IGNORE}


def test_glazed_doors_show_what_is_in_the_cabinet_or_a_pane():
    """Behind a clear door a ray ends 3 cm or more behind the frame, at a pane within 2 cm."""
    clear = 0
    for seed in range(40):
        piece = snug(kitchen_and_bath.wall_cabinet(np.random.default_rng(seed), 1.2))
        width, depth, height = piece.size
        assert width == pytest.approx(1.2)
        assert 0.3 < depth < 0.41
        assert 0.55 <= height <= 0.85
        standing = Standing(piece)
        front = depth - 0.02  # handles stand out by 2 cm
        reached = [
            standing.hit((x, depth + 0.3, z), TOWARDS_THE_BACK)
            for x in np.linspace(0.17, width - 0.13, 7)  # not between two doors
            for z in np.linspace(0.15, height - 0.15, 5)
        ]
        assert {label for label, _ in reached} == {LABEL["cabinet"]}
        behind = np.array([distance for _, distance in reached]) - 0.3 - (depth - front)
        share = (behind > 0.03).mean()
        assert share == 0 or share > 0.4  # one door or the other, everywhere
        clear += share > 0
    assert 10 <= clear <= 26  # 18 of 40 are expected


def test_a_vitrine_stands_and_is_a_cabinet_all_over():
    for piece in forty(kitchen_and_bath.vitrine):
        assert 1.5 < piece.size[2] < 2.1
        assert 0.7 <= piece.size[0] < 1.35
        assert min(part.centre[2] - part.size[2] / 2 for part in piece.parts) == pytest.approx(0)
        assert set(gather(piece.parts).labels.tolist()) == {LABEL["cabinet"]}


def test_a_washstand_is_a_sink_in_a_counter_on_a_cabinet():
    """Seen from above, the middle of a bowl is sink and the left edge counter; seen from before, its doors are cabinet."""
    for piece in forty(kitchen_and_bath.washstand):
        standing, (width, depth, height) = Standing(piece), piece.size
        bowls = [part for part in piece.parts if part.label == LABEL["sink"] and part.size[2] == pytest.approx(0.02)]
        bottom = next(part for part in bowls if part.size[0] > 0.15 and part.size[1] > 0.15)
        x, y, _ = bottom.centre
        label, fallen = standing.hit((x, y, height + 0.5), DOWN)
        assert label == LABEL["sink"]
        assert height + 0.5 - fallen < piece.surface + 0.03  # the bottom, below or just above the top
        assert standing.hit((0.03, depth / 2, height + 0.5), DOWN)[0] == LABEL["counter"]
        assert (
            standing.hit((width / 2 + 0.03, depth + 0.3, piece.surface - 0.25), TOWARDS_THE_BACK)[0] == LABEL["cabinet"]
        )
        assert 0.74 <= piece.surface <= 0.86
