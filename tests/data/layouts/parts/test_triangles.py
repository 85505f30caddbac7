"""Rays on two labelled triangles."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

pytest.importorskip("embreex")

from semgs.data.layouts.parts.mesh_maps import LabelledTriangles, metres
from semgs.data.raycast import Raycaster


@pytest.fixture
def triangles():
    """A small one 2 m ahead, of label 4, before a large one at 3 m, of label 2."""
    vertices = np.array([[-1.0, -1, 2], [1, -1, 2], [0, 1, 2], [-9, -9, 3], [9, -9, 3], [0, 9, 3]])
    faces = np.array([[0, 1, 2], [3, 4, 5]])
    return LabelledTriangles(Raycaster(vertices, faces), np.array([4, 2], np.uint8), np.array([False, False]))


INTRINSICS = np.array([[40.0, 0, 20], [0, 40, 15], [0, 0, 1]])


def test_each_pixel_has_the_label_and_the_millimetres_of_the_nearest_triangle(triangles):
    seen, depth = triangles.cast(np.eye(4), INTRINSICS, (30, 40))
    assert set(np.unique(seen)) == {2, 4}
    assert (depth == np.where(seen == 4, 2000, 3000)).all()


def test_a_hidden_triangle_has_neither_label_nor_depth(triangles):
    seen, depth = replace(triangles, hidden=np.array([True, False])).cast(np.eye(4), INTRINSICS, (30, 40))
    assert set(np.unique(seen)) == {2, 255}
    assert (depth == np.where(seen == 2, 3000, 0)).all()


def from_behind(triangles: LabelledTriangles, metres_behind: float) -> tuple[np.ndarray, np.ndarray]:
    """What a camera sees that far behind the origin, looking ahead: labels, and depths in metres."""
    pose = np.eye(4)
    pose[2, 3] = -metres_behind
    labels, counts = triangles.cast(pose, INTRINSICS, (30, 40))
    return labels, metres(counts)


def test_a_camera_sees_metres(triangles):
    labels, depths = from_behind(triangles, 1)
    assert depths.dtype == np.float32
    assert (labels[15, 20], depths[15, 20]) == (4, 3)
    assert (labels[0, 0], depths[0, 0]) == (2, 4)


def test_beyond_16_bits_of_millimetres_a_label_has_no_depth(triangles):
    # From 63.5 m behind, the triangles are 65.5 and 66.5 m away; 2^16 - 1 millimetres lie between.
    labels, depths = from_behind(triangles, 63.5)
    assert (labels[14, 19], depths[14, 19]) == (4, 65.5)
    assert (labels[0, 0], depths[0, 0]) == (255, 0)
    assert (labels[16, 20], depths[16, 20]) == (2, 0)
