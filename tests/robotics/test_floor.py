"""The height of the floor where points are far away from everything."""

from __future__ import annotations

import numpy as np
import pytest

from semgs.robotics.floor import floor_height


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
