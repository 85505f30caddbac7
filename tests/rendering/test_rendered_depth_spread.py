"""The uncertainty of rendered depth, by hand."""

from __future__ import annotations

import math

import pytest
import torch
from saved_scenes import wall

from semgs.geometry.cameras import Cameras
from semgs.geometry.gaussians import Appearance, Gaussians
from semgs.rendering.render_features import render_depth_spread


def test_a_pixel_of_two_depths_has_the_spread_of_both_and_that_between_them() -> None:
    """Opacities of a half give weights of 1/2 and 1/4, which are 2/3 and 1/3 of the light."""
    camera = Cameras(
        torch.tensor([[[0.0, 0, 1, 1], [1, 0, 0, 2], [0, 1, 0, 3], [0, 0, 0, 1]]], dtype=torch.float64),
        torch.tensor([[[20.0, 0, 4.5], [0, 21, 3.5], [0, 0, 1]]], dtype=torch.float64),
        (7, 11),
    )  # looks along x
    means = torch.tensor([[3.0, 2, 3], [5, 2, 3]])  # 2 m and 4 m away
    shape = Appearance(torch.tensor([[0.8, 0.0, 0.6, 0.0]] * 2), torch.full((2, 3), 0.5), torch.zeros(2, 1, 3))
    gaussians = Gaussians(means, torch.full((2,), 0.5), shape)
    found = render_depth_spread(gaussians, torch.tensor([0.1, 0.2]), camera)
    own = (2 * 0.1**2 + 0.2**2) / 3
    between = 2 / 9 * math.log(2) ** 2
    assert found[0, 3, 4].item() == pytest.approx(math.sqrt(own + between), rel=1e-3)
    assert found.shape == (1, 7, 11)


def test_a_wall_has_the_spread_of_its_gaussians_and_what_is_unseen_has_none() -> None:
    scene = wall()
    spread = torch.full((len(scene.gaussians),), 0.1)
    cameras = scene.cameras[:1].relative_to((0.0, 0.0, 0.0))
    cameras.world_from_camera[:, :3, 3] += 0.9 * cameras.world_from_camera[:, :3, 0]
    found = render_depth_spread(scene.gaussians, spread, cameras, near=scene.near)[0]
    unseen = scene.render(cameras).alphas[0] < 0.5
    assert torch.equal(found.isnan(), unseen)
    assert 0.05 < unseen.float().mean() < 0.6
    assert found[~unseen].median().item() == pytest.approx(0.1, abs=0.01)
