"""Convex upsampling of depth."""

from __future__ import annotations

import math
from dataclasses import replace

import pytest
import torch
from networks import preset
from posed import posed_views

from semgs.geometry.plane_sweep import expected_depth
from semgs.model.networks import small_plain
from semgs.model.settings import NetworkSettings
from semgs.model.sweep.upsampling import ConvexDisparities, ConvexUpsampling, around, bilinear_weights
from semgs.model.switches import switched, switches_of


def disparities(weights: list[float], row: tuple[float, float, float]) -> ConvexDisparities:
    """Of one texel with one Gaussian, all of whose three rows of texels have the same disparities; weights of the middle row."""
    neighbours = torch.tensor([*row, *row, *row]).reshape(1, 9, 1, 1, 1)
    return ConvexDisparities(neighbours, torch.tensor([0.0] * 3 + weights + [0.0] * 3).reshape(1, 9, 1, 1, 1))


def test_at_an_edge_the_mean_is_between_the_surfaces_and_the_mode_on_the_one_with_the_strongest_weight():
    edge = disparities([0.2, 0.3, 0.5], (1.0, 0.96, 0.5))
    assert float(edge.mean()) == pytest.approx(0.2 + 0.288 + 0.25)
    assert float(edge.mode()) == pytest.approx(0.5)
    # The near surface has the larger share, but the strongest single weight decides.
    other = disparities([0.2, 0.45, 0.35], (1.0, 0.96, 0.5))
    assert float(other.mode()) == pytest.approx((0.2 * 1.0 + 0.45 * 0.96) / 0.65)


def test_on_one_surface_mode_and_mean_are_the_same():
    slope = disparities([0.2, 0.5, 0.3], (1.14, 1.0, 0.86))  # all within 15 % of the strongest
    assert float(slope.mode()) == pytest.approx(0.228 + 0.5 + 0.258)
    assert float(slope.mean()) == pytest.approx(0.228 + 0.5 + 0.258)
    beyond = disparities([0.2, 0.5, 0.3], (1.16, 1.0, 0.86))
    assert float(beyond.mode()) == pytest.approx((0.5 + 0.258) / 0.8)


def test_the_neighbours_of_a_texel_are_the_nine_around_it_row_by_row_and_the_border_repeats():
    maps = torch.arange(12.0).reshape(1, 3, 4)
    assert around(maps)[0, :, 1, 2].tolist() == [1, 2, 3, 5, 6, 7, 9, 10, 11]
    assert around(maps)[0, :, 0, 0].tolist() == [0, 0, 1, 0, 0, 1, 4, 4, 5]


def test_bilinear_weights_by_hand():
    # The first Gaussian's centre is a quarter of a texel left of and above the texel's: 3/4 of the texel and 1/4 of the one before.
    weights = bilinear_weights(2)
    assert weights[:, 0].tolist() == [1 / 16, 3 / 16, 0, 3 / 16, 9 / 16, 0, 0, 0, 0]
    assert weights[:, 1].tolist() == [0, 3 / 16, 1 / 16, 0, 9 / 16, 3 / 16, 0, 0, 0]  # the Gaussian to its right
    torch.testing.assert_close(bilinear_weights(4).sum(0), torch.ones(16))


@pytest.mark.parametrize("factor", [2, 4])
def test_bilinear_weights_upsample_as_torch_does(factor: int):
    maps = torch.rand(2, 5, 7, generator=torch.Generator().manual_seed(0)).double()
    weights = bilinear_weights(factor).double()[None, :, :, None, None].expand(2, -1, -1, 5, 7)
    expected = torch.nn.functional.interpolate(maps[:, None], scale_factor=factor, mode="bilinear")[:, 0]
    torch.testing.assert_close(ConvexDisparities(around(maps)[:, :, None], weights).mean(), expected)


def test_it_starts_as_bilinear_upsampling_up_to_the_small_weights():
    torch.manual_seed(0)
    maps = 1 + 0.02 * torch.rand(1, 6, 8)
    start = ConvexUpsampling(8, 2)(torch.rand(1, 3, 12, 16), torch.rand(1, 8, 6, 8), maps, maps, maps)
    expected = torch.nn.functional.interpolate(maps[:, None], scale_factor=2, mode="bilinear")[:, 0]
    torch.testing.assert_close(start.mean(), expected, rtol=2e-3, atol=0)
    torch.testing.assert_close(start.mode(), expected, rtol=2e-3, atol=0)
    torch.testing.assert_close(start.weights.sum(1), torch.ones(1, 4, 6, 8))
    # Five of nine weights start at 0.01 instead of 0, so all are divided by 1.05.
    assert start.weights[0, 4, 0, 3, 3].item() == pytest.approx(9 / 16 / 1.05)


def test_weights_do_not_depend_on_the_unit_of_length():
    torch.manual_seed(0)
    layers, maps = ConvexUpsampling(8, 2), 1 + torch.rand(1, 6, 8)
    torch.nn.init.normal_(layers.layers[-1].weight)
    given = torch.rand(1, 3, 12, 16), torch.rand(1, 8, 6, 8)
    metres, feet = (layers(*given, unit * maps, maps, maps) for unit in (1, 0.3048))
    torch.testing.assert_close(metres.weights, feet.weights, rtol=1e-4, atol=1e-5)
    torch.testing.assert_close(0.3048 * metres.mode(), feet.mode(), rtol=1e-4, atol=1e-5)


def test_gaussians_take_the_mode_of_the_sweep_s_depths_and_no_correction():
    model = preset("small_plain", depth_upsampling="convex").eval()
    torch.nn.init.normal_(model.colour.heads.convex.layers[-1].weight)
    views = posed_views(2, (30, 45))  # padded inside to 32x48
    with torch.inference_mode():
        encoding, swept = model(views), model.sweep(views)
        for parameter in model.colour.heads.refinement.to_disparity.parameters():
            parameter.normal_()
        again = model(views)
    assert swept.finer is not None
    torch.testing.assert_close(encoding.depths, swept.finer.mode, rtol=1e-5, atol=0)
    assert torch.equal(again.depths, encoding.depths)
    assert not torch.equal(again.gaussians.opacities, encoding.gaussians.opacities)
    assert swept.finer.mean.shape == swept.depths.shape == (2, 30, 45)
    texels = expected_depth(swept.probabilities, swept.candidates, swept.spacing)
    assert texels.min() <= swept.finer.mean.min() <= swept.finer.mean.max() <= texels.max()


def test_chunks_of_views_give_the_same_depths():
    from semgs.model.layers.network_input import Chunks

    model = preset("small_plain", depth_upsampling="convex").eval()
    views = posed_views(3, (32, 48))
    with torch.inference_mode():
        whole, parts = model(views), model(views, Chunks(cost=1, heads=1))
    torch.testing.assert_close(whole.depths, parts.depths, rtol=1e-4, atol=0)


def test_without_the_switch_no_tensor_is_added_and_with_it_eight_of_the_part_depth():
    plain, convex = preset("small_plain"), preset("small_plain", depth_upsampling="convex")
    added = convex.state_dict().keys() - plain.state_dict().keys()
    # Four convolutions, weight and bias each.
    assert len(added) == 8
    assert added == convex.upsampling_parameters() <= convex.parts()["depth"]
    assert plain.upsampling_parameters() == set()
    assert plain.sweep(posed_views(2, (16, 32))).finer is None
    assert not convex.upsampling_parameters() & convex.depth_parameters()


def test_the_switch_survives_a_round_trip_through_json_and_old_settings_are_bilinear():
    settings = switched(small_plain(), {"depth_upsampling": "convex"})
    assert switches_of(settings).depth_upsampling == "convex"
    assert NetworkSettings.from_json(settings.as_json()) == settings
    old = small_plain().as_json()
    del old["colour"]["depth"]["upsampling"]
    assert NetworkSettings.from_json(old) == small_plain()


def test_heads_and_conventions_that_do_not_fit_are_refused():
    with pytest.raises(ValueError, match="convex depth_upsampling needs MVSplat's heads"):
        switched(small_plain(), {"depth_upsampling": "convex", "paper_heads": True})
    convex = switched(small_plain(), {"depth_upsampling": "convex"})
    with pytest.raises(ValueError, match="our pixel centres"):
        replace(convex, conventions=replace(convex.conventions, pixel_centres=False))


def test_log_depths_and_their_spread_reach_the_layers_in_tenths():
    """A texel whose neighbour is e^0.2 times as near, and whose log depth is known to 0.05: 2 and 0.5. Its confidence stays as it is."""
    upsampling = ConvexUpsampling(features=5, factor=2)
    seen: list[torch.Tensor] = []
    upsampling.layers.register_forward_pre_hook(lambda _, given: seen.append(given[0]))
    disparities = torch.tensor([[[1.0, math.exp(0.2)]]])
    upsampling(
        torch.rand(1, 3, 2, 4),
        torch.rand(1, 5, 1, 2),
        disparities,
        torch.full((1, 1, 2), 0.7),
        torch.full((1, 1, 2), 0.05),
    )
    depth = seen[0][
        0, 12 + 5 :, 0, 0
    ].tolist()  # after the pixels and the features: eight neighbours, confidence, spread
    assert depth == pytest.approx([0, 0, 2, 0, 2, 0, 0, 2, 0.7, 0.5], abs=1e-6)
