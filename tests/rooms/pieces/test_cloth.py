import numpy as np
import pytest

pytest.importorskip("embreex")

from standing import Standing

from semgs_rooms.pieces import cloth
from semgs_rooms.pieces.furniture import LABEL
from semgs_rooms.pieces.solids import gather
from semgs_rooms.pieces.texture_kernels import COLOUR_A
from semgs_rooms.plans.builder import snug


def forty(maker):
    return [snug(maker(np.random.default_rng(seed))) for seed in range(40)]


def test_canvas_wardrobes_are_cabinets_taller_than_wide_flaps_and_usually_white():
    wardrobes = forty(cloth.canvas_wardrobe)
    widths, depths, heights = np.array([piece.size for piece in wardrobes]).T
    assert widths.min() > 0.65
    assert widths.max() < 2.05
    assert depths.min() >= 0.4
    assert depths.max() < 0.6
    assert heights.min() >= 1.5
    assert heights.max() <= 1.82
    assert {label for piece in wardrobes for label in gather(piece.parts).labels.tolist()} == {LABEL["cabinet"]}
    canvas = np.array([piece.parts[4].material[COLOUR_A : COLOUR_A + 3] for piece in wardrobes])
    assert 0.4 < ((canvas.min(axis=1) > 0.35) & (np.ptp(canvas, axis=1) < 0.2)).mean() < 0.9


def test_a_flap_hangs_within_5_cm_of_the_front_unless_it_is_rolled_up():
    """A ray at knee height meets cloth at every flap, at an open one a shirt or a shelf further in, or the back."""
    opened = 0
    for piece in forty(cloth.canvas_wardrobe):
        standing, (width, depth, _) = Standing(piece), piece.size
        reached = [standing.hit((x, depth + 0.4, 0.55), (0, -1, 0)) for x in np.linspace(0.1, width - 0.1, 15)]
        assert {label for label, _ in reached} == {LABEL["cabinet"]}
        inside = np.array([distance for _, distance in reached]) - 0.4 > 0.12
        assert inside.mean() < 1 or width < 0.8
        opened += bool(inside.any())
    assert 6 <= opened <= 22  # 14 of 40 are expected


def test_the_back_of_a_corner_sofa_is_closed_from_below_the_seat_to_the_top():
    for piece in forty(cloth.corner_sofa):
        standing, (width, depth, height) = Standing(piece), piece.size
        assert 2.0 < width < 2.9
        assert 1.4 < depth < 1.8
        for x in np.linspace(0.1, width - 0.1, 9):
            for z in np.linspace(0.2, 0.6, 4):
                assert standing.hit((x, -1.0, z), (0, 1, 0))[0] == LABEL["sofa"]
        assert set(gather(piece.parts).labels.tolist()) == {LABEL["sofa"]}
        assert 0.7 < height < 1.1
