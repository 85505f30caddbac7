"""Which entries of two streams are of the same time."""

from __future__ import annotations

import numpy as np
from traced_memory import most_memory

from semgs.data.layouts.parts.trajectories import associate


def test_the_nearest_pose_of_a_motion_capture_at_1000_hz_is_taken():
    """Images each 33.4 ms; the pose nearest to 0.0334 k is number round(33.4 k)."""
    poses = np.arange(2000) / 1000
    images = 0.0334 * np.arange(50)
    assert associate(images, poses) == {k: round(33.4 * k) for k in range(50)}


def test_nearest_pairs_come_first_and_each_entry_is_used_once():
    assert associate(np.array([0.0, 0.015]), np.array([0.012, 0.03])) == {1: 0}
    assert associate(np.array([0.0, 0.015]), np.array([0.012, 0.019])) == {0: 1, 1: 0}


def test_times_that_are_all_equal_cost_no_more_than_others():
    equal = np.zeros(1000)
    assert most_memory(lambda: associate(equal, equal)) < 15e6
