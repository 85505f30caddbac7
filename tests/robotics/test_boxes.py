from __future__ import annotations

from math import cos, degrees, radians, sin, sqrt

import numpy as np
import pytest

from semgs.robotics.boxes import EDGES, Box, box_of

pytest.importorskip("trimesh")


def lattice(length: float, width: float, height: float) -> np.ndarray:
    """Points on a lattice of 11 x 6 x 9 around the origin."""
    axes = [np.linspace(-side / 2, side / 2, count) for side, count in ((length, 11), (width, 6), (height, 9))]
    return np.stack(np.meshgrid(*axes, indexing="ij"), -1).reshape(-1, 3)


def turned(points: np.ndarray, yaw: float) -> np.ndarray:
    """Points turned about z [degrees]."""
    a = radians(yaw)
    return points @ np.array([[cos(a), sin(a), 0], [-sin(a), cos(a), 0], [0, 0, 1.0]])


@pytest.mark.parametrize("yaw", [30.0, -75.0])
def test_a_turned_box_has_its_sides_and_its_yaw(yaw: float) -> None:
    found = box_of(turned(lattice(2.0, 0.5, 0.8), yaw) + np.array((3.0, -1.0, 0.4)))
    assert found.size == pytest.approx((2.0, 0.5, 0.8))
    assert found.centre == pytest.approx((3.0, -1.0, 0.4))
    assert degrees(found.yaw) == pytest.approx(yaw)


def test_one_point_of_a_hundred_with_wrong_depth_does_not_change_a_box() -> None:
    points = turned(lattice(2.0, 0.5, 0.8), 30.0)
    astray = turned(np.array([[5.0, 0.1, 0.0], [-4.0, 0.2, 0.1], [0.1, 3.0, 0.2], [0.2, 0.1, 9.0]]), 30.0)
    found = box_of(np.concatenate((points, astray)))
    assert found.size == pytest.approx((2.0, 0.5, 0.8), abs=1e-6)
    assert degrees(found.yaw) == pytest.approx(30.0)


def test_heights_are_from_the_2nd_to_the_98th_percentile() -> None:
    points = np.zeros((101, 3))
    points[:, 0], points[:, 2] = np.arange(101) % 7, np.arange(101) / 100
    assert box_of(points).size[2] == pytest.approx(0.96)
    assert box_of(points).centre[2] == pytest.approx(0.5)


def test_points_on_a_line_and_a_single_point_have_boxes_without_width() -> None:
    line = np.linspace(0, 1, 50)[:, None] * (3.0, 4.0, 0.0)
    assert box_of(line).size == pytest.approx(
        (5 * 0.9592, 0.0, 0.0), abs=1e-3
    )  # 47 of 49 steps are inside the percentiles
    assert degrees(box_of(line).yaw) == pytest.approx(degrees(np.arctan2(4, 3)))
    assert box_of(np.array([[1.0, 2.0, 3.0]])) == Box((1.0, 2.0, 3.0), (0.0, 0.0, 0.0), 0.0)


def test_the_distance_to_a_turned_box_is_that_to_its_nearest_point() -> None:
    box = Box((0.0, 0.0, 0.0), (2.0, 2.0, 2.0), radians(45))
    assert box.distance(np.array([3.0, 0.0, 0.0])) == pytest.approx(3 - sqrt(2))  # to an edge
    assert box.distance(np.array([0.0, 0.0, 4.0])) == pytest.approx(3.0)
    assert box.distance(np.array([0.1, 0.2, -0.3])) == 0


def test_edges_join_corners_along_one_axis_each() -> None:
    corners = Box((1.0, 2.0, 3.0), (4.0, 2.0, 1.0), radians(30)).corners
    lengths = sorted(np.linalg.norm(corners[a] - corners[b]) for a, b in EDGES)
    assert lengths == pytest.approx([1.0] * 4 + [2.0] * 4 + [4.0] * 4)
    assert corners.mean(0) == pytest.approx((1.0, 2.0, 3.0))
    # The first edge is along the length: (cos 30, sin 30) * 4.
    assert corners[EDGES[0][1]] - corners[EDGES[0][0]] == pytest.approx((2 * sqrt(3), 2.0, 0.0))
