"""Which frames become keyframes, on a wall."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest
import torch
from mapping_walls import INTRINSICS, SIZE, WALL, pose

from semgs.data.choosing.covisibility import flat_grid
from semgs.geometry.cameras import Cameras
from semgs.mapping.keyframes import NEIGHBOURS, Known, judge_frame, near, predict_depths


def at(x: float, yaw: float = 0.0) -> Cameras:
    return Cameras(pose(x, yaw=yaw), INTRINSICS, SIZE)


def test_the_first_frame_is_a_keyframe_without_a_window():
    verdict = judge_frame(at(0.0), [], 1, 4.0)
    assert (verdict.use, verdict.partners, verdict.covered) == (True, (), 0.0)


def test_a_frame_waits_for_baseline_as_long_as_most_is_shared():
    """The ideal baseline begins at 5 % of the depth: 0.2 m of 4 m."""
    known = [Known(at(0.0), None)]
    assert not judge_frame(at(0.15), known, 1, 4.0).use
    assert judge_frame(at(0.25), known, 1, 4.0).partners == (0,)


def test_a_frame_that_shows_nothing_new_is_not_used():
    """Between two keyframes with Gaussians, all is seen; one and a half metres to the right, a third of the image is new."""
    known = [Known(at(x), flat_grid(WALL)) for x in (0.0, 0.6)]
    assert judge_frame(at(0.3), known, 1, 4.0).covered == 1.0
    beside = judge_frame(at(1.9), known, 2, 4.0)
    assert beside.use
    assert beside.partners == (1, 0)
    assert 0.6 < beside.covered < 0.8


def test_a_frame_that_shares_nothing_becomes_a_keyframe_of_its_own():
    verdict = judge_frame(at(0.0, yaw=math.pi), [Known(at(0.0), flat_grid(WALL))], 1, 4.0)
    assert (verdict.use, verdict.partners) == (True, ())


def test_neighbours_are_the_nearest_that_look_a_similar_way():
    known = [Known(at(0.1 * number, yaw=math.pi if number == 3 else 0.0), None) for number in range(30)]
    assert near(at(0.0), known) == [number for number in range(NEIGHBOURS + 1) if number != 3]


def test_predicted_depth_is_that_of_the_wall_from_another_place():
    """A keyframe 4 m from the wall says 3 m to a camera that is 1 m closer, everywhere."""
    closer = Cameras(pose(0.2, z=1.0), INTRINSICS, SIZE)
    grid = predict_depths(closer, [Known(at(0.0), flat_grid(WALL))], 9.0)
    np.testing.assert_allclose(grid.depths, 3.0)
    assert predict_depths(closer, [], 9.0).median == pytest.approx(9.0)


def test_of_two_surfaces_in_a_cell_the_nearer_one_is_predicted():
    """One keyframe saw a wall at 4 m, another a cupboard at 3 m before it, from the same place."""
    for order in ((3.0, 4.0), (4.0, 3.0)):
        grid = predict_depths(at(0.0), [Known(at(0.0), flat_grid(depth)) for depth in order], 9.0)
        np.testing.assert_allclose(grid.depths, 3.0)


def test_predicted_cells_are_shares_of_the_height_and_of_the_width():
    """A keyframe whose upper half saw 3 m and whose lower half 5 m says the same to a frame at its place, though images are wider than high."""
    depths = np.repeat([3.0, 5.0], 50)
    grid = predict_depths(at(0.0), [Known(at(0.0), replace(flat_grid(1.0), depths=depths))], 9.0)
    np.testing.assert_allclose(grid.depths, depths)


def test_the_way_a_camera_looks_is_its_optical_axis():
    """A camera that is rolled by 180 degrees looks the same way; one that is turned about its own x axis does not."""
    rolled, turned = pose(0.1), pose(0.1)
    rolled[:3, :3] = torch.diag(torch.tensor([-1.0, -1, 1]).double())
    turned[:3, :3] = torch.diag(torch.tensor([1.0, -1, -1]).double())
    known = [Known(Cameras(one, INTRINSICS, SIZE), None) for one in (rolled, turned)]
    assert near(at(0.0), known) == [0]
