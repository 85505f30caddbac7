"""The depth camera of `scripts/sensor_depth.py`, before walls whose depth is known."""

from __future__ import annotations

import runpy
from pathlib import Path

import pytest
import torch
from posed import posed_views

from semgs.data.views import Views

SCRIPT = runpy.run_path(str(Path(__file__).parents[2] / "scripts" / "sensor_depth.py"))
SIZE = (48, 64)


def wall(depth: float, light: float = 0.5) -> Views:
    """A wall that faces two cameras, its depth and brightness everywhere the same."""
    views = posed_views(2, SIZE)
    return views.changed(images=torch.full_like(views.images, light), depths=torch.full((2, *SIZE), depth))


def test_a_wall_at_4_m_is_measured_with_the_noise_of_that_depth():
    """1.2 mm + 1.9 mm * 3.6^2 = 25.8 mm, over 6144 pixels."""
    found = SCRIPT["measured"](wall(4.0), 0)
    assert (found > 0).all()
    assert float(found.std()) == pytest.approx(0.0258, rel=0.05)
    assert float(found.mean()) == pytest.approx(4, abs=0.002)


@pytest.mark.parametrize(
    ("views", "share"), [(wall(0.3), 0), (wall(6.0), 0), (wall(4.0, light=0.03), 0), (wall(4.0, light=0.97), 0.5)]
)
def test_near_far_and_dark_walls_are_not_measured_and_shiny_ones_in_patches(views: Views, share: float):
    assert float((SCRIPT["measured"](views, 0) > 0).float().mean()) == pytest.approx(share, abs=0.1)


def test_nothing_is_measured_beside_an_edge():
    views = wall(2.0)
    views.depths[:, :, 32:] = 3.0
    found = SCRIPT["measured"](views, 0)
    assert (found[:, 2:-2, 31:33] == 0).all()
    assert (found[:, :, :28] > 0).all()
    assert (found[:, :, 36:] > 0).all()
