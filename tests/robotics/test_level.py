from __future__ import annotations

import numpy as np
import pytest

from semgs.robotics.floor import level_from_world


@pytest.mark.parametrize(
    "up", [(0.0, 0.0, 2.0), (0.6, 0.0, 0.8), (0.0, -1.0, 0.0), (0.0, 0.0, -1.0), (0.3, -0.4, -0.5)]
)
def test_up_becomes_z_by_a_rotation(up: tuple[float, float, float]) -> None:
    rotation = level_from_world(up)
    np.testing.assert_allclose(rotation @ up, (0, 0, np.linalg.norm(up)), atol=1e-12)
    np.testing.assert_allclose(rotation @ rotation.T, np.eye(3), atol=1e-12)
    assert np.linalg.det(rotation) == pytest.approx(1)


def test_a_world_with_z_up_stays_as_it_is() -> None:
    np.testing.assert_array_equal(level_from_world((0.0, 0.0, 1.0)), np.eye(3))


@pytest.mark.parametrize("up", [(0.0, 0.0, 0.0), (0.0, float("nan"), 1.0), (1.0, 0.0)])
def test_what_is_no_direction_is_refused(up: tuple[float, ...]) -> None:
    with pytest.raises(ValueError, match="expected a direction of three numbers"):
        level_from_world(up)
