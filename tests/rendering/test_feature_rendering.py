"""Rendered features: sum w f / sum w, and nothing where there is next to no weight."""

from __future__ import annotations

import pytest
import torch

from semgs.geometry.cameras import Cameras
from semgs.geometry.gaussians import Appearance, Gaussians
from semgs.rendering import reference
from semgs.rendering.render import render
from semgs.rendering.render_features import LEAST_ALPHA, gather_maps, render_features
from semgs.rendering.splats import Pinhole, Splats

NEAR = 1.0


@pytest.mark.parametrize("semantic", [True, False])
@pytest.mark.parametrize("backend", ["numba", "reference"])
def test_features_equal_the_reference_pass_for_pass(random_scene, backend: str, semantic: bool):
    """37 channels, which are more than one pass has; the twin splats them with a channel of ones, whose blend is sum w."""
    gaussians, cameras = random_scene(5, count=80, views=2, size=(13, 17))
    if not semantic:
        gaussians = Gaussians(gaussians.means, gaussians.opacities, gaussians.colour)
    features = torch.randn(80, 37, generator=torch.Generator().manual_seed(1), dtype=torch.float64)
    found = render_features(gaussians, features, cameras, near=NEAR, backend=backend)
    shape = gaussians.semantic if semantic else gaussians.colour
    nothing = 0
    for view in range(2):
        camera = Pinhole.of(cameras[view])
        order = reference.depth_order(gaussians.means, camera, NEAR)
        with_ones = torch.cat((features, torch.ones(80, 1).double()), dim=1)
        splats = Splats(gaussians.means, shape.quaternions, shape.scales, gaussians.opacities, with_ones)
        picture = reference.splat(splats, order, camera).picture
        weight = picture[37]
        empty = weight < 0.05
        nothing += int(empty.sum())
        assert torch.equal(found.features[view].isnan(), empty.expand(37, -1, -1))
        torch.testing.assert_close(found.alphas[view], weight, rtol=0, atol=1e-10)
        torch.testing.assert_close(
            found.features[view][:, ~empty], (picture[:37] / weight)[:, ~empty], rtol=0, atol=1e-8
        )
    assert 10 < nothing < 2 * 13 * 17 - 10


def in_a_row(*opacities: float) -> tuple[Gaussians, Cameras]:
    """Broad Gaussians one behind the other on the axis through the middle of pixel (2, 3), nearest first."""
    count = len(opacities)
    quaternions = torch.tensor([1.0, 0, 0, 0]).double().expand(count, 4)
    shape = Appearance(quaternions, torch.full((count, 3), 0.5).double(), torch.zeros(count, 1, 3).double())
    means = torch.tensor([[0.0, 0, 2 + index] for index in range(count)]).double()
    k = torch.tensor([[8.0, 0, 3.5], [0, 8, 2.5], [0, 0, 1]]).double()
    return Gaussians(means, torch.tensor(opacities).double(), shape), Cameras(torch.eye(4).double()[None], k[None], (6, 9))  # fmt: skip


def test_the_front_counts_by_its_alpha_and_the_back_by_what_is_left():
    """Alphas 0.4 and 0.5: weights 0.4 and 0.6 x 0.5 = 0.3, so the feature is (4/7, 3/7)."""
    gaussians, cameras = in_a_row(0.4, 0.5)
    found = render_features(gaussians, torch.eye(2).double(), cameras)
    assert found.alphas[0, 2, 3] == pytest.approx(0.7)
    assert found.features[0, :, 2, 3].tolist() == pytest.approx([4 / 7, 3 / 7])


@pytest.mark.parametrize(("opacity", "there"), [(0.06, True), (0.04, False)])
def test_a_faint_gaussian_has_its_whole_feature_or_none(opacity: float, there: bool):
    assert LEAST_ALPHA == 0.05
    gaussians, cameras = in_a_row(opacity)
    found = render_features(gaussians, torch.tensor([[3.0, -2.0]]).double(), cameras).features[0, :, 2, 3]
    if there:
        assert found.tolist() == pytest.approx([3, -2])
    else:
        assert found.isnan().all()


def test_features_of_other_gaussians_are_refused():
    gaussians, cameras = in_a_row(0.4, 0.5)
    with pytest.raises(ValueError, match=r"features are \(3, 2\) for \(2,\) Gaussians"):
        render_features(gaussians, torch.zeros(3, 2), cameras)


def test_a_map_goes_to_the_gaussians_by_what_they_show_of_it():
    """The same weights: of a pixel of 10, the front gets 4 and the back 3. All pixels of ones add up to the light that is stopped."""
    gaussians, cameras = in_a_row(0.4, 0.5)
    pixel, ones = torch.zeros(1, 1, 6, 9).double(), torch.ones(1, 1, 6, 9).double()
    pixel[0, 0, 2, 3] = 10
    (found,) = gather_maps(gaussians, pixel, cameras)
    assert found[:, 0].tolist() == pytest.approx([4, 3])
    (covered,) = gather_maps(gaussians, ones, cameras)
    assert float(covered.sum()) == pytest.approx(float(render(gaussians, cameras).alphas.sum()))
