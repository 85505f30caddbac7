"""One camera as the back-ends take it, by hand."""

from __future__ import annotations

import pytest
import torch
from posed import posed_cameras

from semgs.rendering.splats import Pinhole, near_plane

SIZE = (20, 35)


def test_axes_are_the_cameras_in_the_world_and_offsets_start_at_its_centre() -> None:
    cameras = posed_cameras(1, SIZE)
    camera = Pinhole.of(cameras[0])
    pose = cameras.world_from_camera[0]
    for axis in range(3):
        assert torch.equal(camera.axes[axis], pose[:3, axis])
    inside = torch.tensor([[0.3, -0.2, 1.7]], dtype=torch.float64)
    world = inside @ pose[:3, :3].mT + pose[:3, 3]
    torch.testing.assert_close(camera.offsets(world) @ camera.axes.mT, inside)


def test_slopes_end_15_percent_of_the_pictures_sides_outside_it() -> None:
    cameras = posed_cameras(1, SIZE)
    camera, k = Pinhole.of(cameras[0]), cameras.intrinsics[0]
    (left, right), (top, bottom) = camera.slope_limits
    assert (k[0, 0] * left + k[0, 2]).item() == pytest.approx(-0.15 * 35)
    assert (k[0, 0] * right + k[0, 2]).item() == pytest.approx(1.15 * 35)
    assert (k[1, 1] * top + k[1, 2]).item() == pytest.approx(-0.15 * 20)
    assert (k[1, 1] * bottom + k[1, 2]).item() == pytest.approx(1.15 * 20)
    assert camera.principal_px == (k[0, 2].item(), k[1, 2].item())


def test_the_near_plane_is_a_fifth_of_the_near_bound_or_a_fiftieth_of_the_median_in_front() -> None:
    depths = torch.tensor([-7.0, 0.5, 3.0, 10.0, -2.0], dtype=torch.float64)
    assert near_plane(depths, 0.5) == pytest.approx(0.1)
    assert near_plane(depths, None) == pytest.approx(0.06)
    assert near_plane(depths[:1], None) == 0
