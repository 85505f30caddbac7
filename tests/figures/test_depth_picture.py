from __future__ import annotations

import numpy as np
import pytest

from semgs.figures.view_images import WORST_ERROR, depth_bar, depth_error_bar, depth_error_picture, depth_ticks
from semgs.files.images.colours import NOTHING, depth_limits, depth_picture


def test_limits_span_what_has_depth_and_a_few_outliers_do_not_move_them() -> None:
    depths = np.linspace(2, 4, 1000).reshape(20, 50)
    depths[0, :3] = [0, 1000, 0]
    low, high = depth_limits([depths, np.full((2, 2), 3.0)])
    assert low == pytest.approx(2.02, abs=0.02)
    assert high == pytest.approx(3.98, abs=0.02)


def test_limits_of_one_depth_or_none_are_still_an_interval() -> None:
    assert depth_limits([np.zeros((2, 3))]) == (1, 10)
    assert depth_limits([]) == (1, 10)
    low, high = depth_limits([np.full((2, 3), 2.0)])
    assert low < 2 < high


def test_the_ticks_stand_where_the_bar_has_the_colour_of_their_depth() -> None:
    limits = (0.5, 8.0)
    ticks = depth_ticks(limits, 5)
    assert ticks == pytest.approx((0.5, 1, 2, 4, 8))
    colours = depth_picture(np.array([ticks]), limits)[0]
    assert (colours == depth_bar()[0, np.rint(np.linspace(0, 255, 5)).astype(int)]).all()


def test_equal_depths_look_equal_nothing_is_grey_and_the_bar_has_the_same_colours() -> None:
    depths = np.array([[1.0, 2.0, 3.0], [0.0, 99.0, 1e-3]])
    picture = depth_picture(depths, (1.0, 3.0))
    bar = depth_bar()
    assert bar.shape == (1, 256, 3)
    assert (picture[0, 0] == bar[0, 0]).all()
    assert (picture[0, 2] == bar[0, 255]).all()
    assert (picture[1, 1] == bar[0, 255]).all()  # clamped
    assert (picture[1, 2] == bar[0, 0]).all()
    assert (picture[1, 0] == NOTHING).all()
    assert bar[0, 40, 0] > bar[0, 40, 2]  # near is red
    assert bar[0, 220, 0] < bar[0, 220, 2]  # far is blue


def test_errors_are_relative_those_beyond_the_worst_look_alike_and_unknown_truth_is_grey() -> None:
    truth = np.array([[2.0, 2.0, 4.0, 4.0, 0.0]])
    depths = np.array([[2.0, 2.0 * (1 + WORST_ERROR), 4.0 * (1 - WORST_ERROR / 2), 0.0, 3.0]])
    picture = depth_error_picture(depths, truth)[0]
    bar = depth_error_bar()[0]
    assert (picture[0] == bar[0]).all()
    assert (picture[1] == bar[-1]).all()
    assert (picture[2] == bar[128]).all() or (picture[2] == bar[127]).all()
    assert (picture[3] == bar[-1]).all()
    assert (picture[4] == NOTHING).all()


def test_colours_are_those_of_matplotlib() -> None:
    from matplotlib import colormaps

    def of(name: str, reverse: bool) -> np.ndarray:
        colours = np.rint(255 * colormaps[name].resampled(256)(np.arange(256))[:, :3]).astype(np.uint8)
        return colours[::-1] if reverse else colours

    np.testing.assert_array_equal(depth_bar()[0], of("turbo", reverse=True))
    np.testing.assert_array_equal(depth_error_bar()[0], of("inferno", reverse=False))
