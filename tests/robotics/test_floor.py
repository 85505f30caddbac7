"""The height of the floor where points are far away from everything."""

from __future__ import annotations

import numpy as np
import pytest

from semgs.robotics.floor import NoFloorError, floor_height


@pytest.mark.parametrize("far", [-5e3, -1e30])
def test_a_point_far_below_is_not_where_the_search_for_the_floor_starts(far: float) -> None:
    """200 points of the floor at 3 cm, 300 of a table, and one that is nowhere. In bins of 2 cm, 5 km would be 250,000 and 1e30 m would not fit into memory."""
    heights, eyes = np.concatenate((np.full(300, 0.72), np.full(200, 0.03), [far])), np.array([1.2])
    assert floor_height(heights, np.ones(501), eyes) == pytest.approx(0.03)
    assert floor_height(heights, np.ones(501), eyes, heights < 0.5) == pytest.approx(0.03)


def test_a_step_below_the_floor_is_not_the_floor():
    """200 points of the floor at 30 cm, and, of the same class, 80 of a step down at 12 cm, which is lower and emptier."""
    heights = np.concatenate((np.full(200, 0.30), np.full(80, 0.12), np.full(300, 1.0)))
    assert floor_height(heights, np.ones(580), np.array([1.8]), heights < 0.5) == pytest.approx(0.30)


@pytest.mark.parametrize(
    ("below", "said", "found"), [(60, False, False), (60, True, True), (40, False, True), (200, True, False)]
)
def test_if_it_is_said_which_way_is_up_more_may_be_below_the_floor(below: int, said: bool, found: bool):
    """940 points of the floor and a table, and some of a step that leads down: 60 are 6 %, 40 4 % and 200 18 %."""
    heights = np.concatenate((np.full(500, 0.0), np.full(440, 0.8), np.full(below, -0.4)))
    arguments = (heights, np.ones(len(heights)), np.array([1.5]), heights > -0.2)
    if found:
        assert floor_height(*arguments, up_is_known=said) == pytest.approx(0.0)
    else:
        with pytest.raises(NoFloorError, match=f"at most {15 if said else 5}% may be"):
            floor_height(*arguments, up_is_known=said)
