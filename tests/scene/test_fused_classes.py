"""Input views that agree on the classes of the points that several of them see."""

from __future__ import annotations

import math

import pytest
import torch
from golden import fill_golden
from networks import preset
from posed import posed_views

from semgs.data.views import stack
from semgs.geometry.cameras import Cameras, back_project
from semgs.geometry.fusion import LEAST
from semgs.geometry.gaussians import Appearance, Gaussians
from semgs.model.networks import NETWORKS
from semgs.model.settings import NetworkSettings
from semgs.scene.encoding import Encoding

SIZE, GRID = (11, 18), (6, 9)
"""Of the views and of their Gaussians, one per 2x2 pixels; the last row stands for half as many."""


def cameras(scale: float, size: tuple[int, int]) -> Cameras:
    """Two that look the same way, 1 m apart along x; focal length 16 px at full size."""
    poses = torch.eye(4, dtype=torch.float64).repeat(2, 1, 1)
    poses[1, 0, 3] = 1.0
    intrinsics = torch.diag(torch.tensor([scale, scale, 1.0], dtype=torch.float64)) @ torch.tensor(
        [[16.0, 0, 8.6], [0, 16, 5.2], [0, 0, 1]], dtype=torch.float64
    )
    return Cameras(poses, intrinsics.repeat(2, 1, 1), size)


def wall(second: float = 4.0) -> Encoding:
    """A wall at 4 m; the first view's Gaussians say (0.9, 0.1), the second's (0.4, 0.6) at another depth if one is given."""
    depths = torch.stack((torch.full(GRID, 4.0), torch.full(GRID, second))).double()
    means = back_project(depths, cameras(0.5, GRID)).reshape(-1, 3)
    count = len(means)
    quaternions, scales = torch.tensor([1.0, 0, 0, 0]).double().expand(count, 4), torch.full((count, 3), 0.1).double()
    said = torch.tensor([[0.9, 0.1], [0.4, 0.6]], dtype=torch.float64).repeat_interleave(count // 2, 0)
    gaussians = Gaussians(
        means,
        torch.full((count,), 0.5).double(),
        Appearance(quaternions, scales, torch.zeros(count, 1, 3).double()),
        Appearance(quaternions, scales, said),
    )
    maps = torch.ones(2, *SIZE).double()
    return Encoding(gaussians, 4 * maps, maps, 0.01 * maps, torch.tensor([[0.5, 9.0]] * 2), stride=2)


def test_a_gaussian_takes_the_mean_of_the_log_probabilities_of_the_views_that_see_it():
    """16 px * 1 m / 4 m are 4 pixels, two Gaussians: the first two columns of view 0 are its own alone, and the last two of view 1."""
    encoding = wall()
    found = encoding.fused(cameras(1, SIZE)).gaussians.semantic.features.view(2, *GRID, 2)
    first, second = (math.sqrt((a + LEAST) * (b + LEAST)) for a, b in ((0.9, 0.4), (0.1, 0.6)))
    both = torch.tensor([first, second], dtype=torch.float64) / (first + second)
    expected = torch.empty(2, *GRID, 2, dtype=torch.float64)
    expected[:] = both
    expected[0, :, :2] = torch.tensor([0.9 + LEAST, 0.1 + LEAST]) / (1 + 2 * LEAST)
    expected[1, :, 7:] = torch.tensor([0.4 + LEAST, 0.6 + LEAST]) / (1 + 2 * LEAST)
    torch.testing.assert_close(found, expected, rtol=0, atol=1e-7)


def test_a_view_that_sees_something_nearer_has_no_say():
    """4 m and 3 m are 14 standard deviations of 0.02 apart; one view alone keeps its likeliest class."""
    found = wall(3.0).fused(cameras(1, SIZE)).gaussians.semantic.features.view(2, *GRID, 2)
    assert (found[0] - torch.tensor([0.9, 0.1])).abs().max() < 2e-3
    assert (found[1] - torch.tensor([0.4, 0.6])).abs().max() < 2e-3


def test_gaussians_without_classes_or_of_parts_of_views_are_refused():
    encoding = wall()
    for other in (
        Encoding(encoding.gaussians.map(lambda one: one), *encoding.tensors()[-4:], places=torch.arange(108)),
        fill_golden(preset("mvsplat")).eval()(posed_views(2, (32, 48))),
    ):
        with pytest.raises(ValueError, match="expected Gaussians with classes, one for each pixel"):
            other.fused(cameras(1, SIZE))


def test_the_network_fuses_outside_training_only_and_scene_by_scene():
    model, one, other = (
        fill_golden(preset("small_plain", class_fusion=True)),
        posed_views(2, (32, 48)),
        posed_views(2, (32, 48), seed=5),
    )
    with torch.inference_mode():
        fused = model.eval()(one).gaussians.semantic.features
        model.fuses = False
        apart = model(one)
        assert (apart.gaussians.semantic.features - fused).abs().max() > 1e-3
        assert torch.equal(apart.fused(one.cameras).gaussians.semantic.features, fused)
        model.fuses = True
        batch = model(stack([one, other])).gaussians.semantic.features
        torch.testing.assert_close(batch[0], fused, rtol=0, atol=1e-5)
        torch.testing.assert_close(batch[1], model(other).gaussians.semantic.features, rtol=0, atol=1e-5)
        torch.testing.assert_close(
            model.train()(one).gaussians.semantic.features, apart.gaussians.semantic.features, rtol=0, atol=1e-5
        )


def test_small_alone_fuses_and_files_that_do_not_say_are_of_networks_that_do_not():
    branches = {name: settings().semantic for name, settings in NETWORKS.items()}
    assert [name for name, branch in branches.items() if branch and branch.fusion] == ["small"]
    saved = preset("small_plain", class_fusion=True).settings.as_json()
    assert NetworkSettings.from_json(saved).semantic.fusion
    del saved["semantic"]["fusion"]
    assert not NetworkSettings.from_json(saved).semantic.fusion
