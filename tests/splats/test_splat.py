"""What formats of splats share."""

from __future__ import annotations

import numpy as np

from semgs.splats.splat import with_largest


def test_the_largest_of_a_quaternion_goes_to_its_place_and_the_others_keep_their_order() -> None:
    """(0.1, 0.5, 0.5) leaves 1 - 0.01 - 0.25 - 0.25 = 0.7^2; what is longer than a unit quaternion leaves 0."""
    others = np.array([[0.1, 0.5, 0.5]] * 4 + [[0.8, 0.8, 0.0]])
    found = with_largest(others, np.array([0, 1, 2, 3, 1]))
    expected = [
        [0.7, 0.1, 0.5, 0.5],
        [0.1, 0.7, 0.5, 0.5],
        [0.1, 0.5, 0.7, 0.5],
        [0.1, 0.5, 0.5, 0.7],
        [0.8, 0, 0.8, 0],
    ]
    np.testing.assert_allclose(found, expected, atol=1e-12)
