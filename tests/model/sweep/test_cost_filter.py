"""The 3D filter of the cost volume."""

from __future__ import annotations

import torch
from torch import nn

from semgs.model.layers.cnn import lay_out
from semgs.model.sweep.cost_volume import CostFilter


def test_it_starts_as_nothing_and_leaves_every_size():
    torch.manual_seed(0)
    for shape in ((2, 8, 6, 10), (1, 7, 5, 9)):
        cost = torch.rand(shape)
        torch.testing.assert_close(CostFilter(4)(cost), cost, rtol=0, atol=0)


def test_a_bump_spreads_to_neighbours_in_the_view_and_in_depth_and_to_no_other_view():
    """All kernels have one weight, 1 at their middle, so the correction is known by hand."""
    layers = CostFilter(1).double()
    for layer in layers.children():
        nn.init.zeros_(layer.weight)
        nn.init.zeros_(layer.bias)
    for layer in (layers.down, layers.last):
        layer.weight.data[0, 0, 1, 1, 1] = 1
    cost = torch.zeros(2, 8, 8, 8, dtype=torch.float64)
    cost[0, 4, 4, 4] = 40.0  # stride 2 picks even places: this is place (2, 2, 2) at half size, where gelu(40) = 40
    corrected = (layers(cost) - cost).detach()
    # Twice as wide, centres at .5: places 4 and 5 lie a quarter off place 2, and 3 and 6 three quarters; weights 3/4 and 1/4 on each axis.
    assert corrected[0, 4, 5, 4] == 40 * 0.75**3
    assert corrected[0, 3, 4, 6] == 40 * 0.25 * 0.75 * 0.25
    assert corrected[0, 2, 4, 4] == 0
    assert not corrected[1].any()


def test_candidates_far_apart_and_texels_far_apart_reach_each_other_through_the_coarse_level():
    torch.manual_seed(0)
    layers = CostFilter(2).double()
    nn.init.normal_(layers.last.weight)
    cost = torch.rand(1, 32, 32, 32, dtype=torch.float64, requires_grad=True)
    layers(cost)[0, 16, 16, 16].backward()
    seen = torch.nonzero(cost.grad[0])
    # Read backwards from place 16: 7 and 8 at half size by the widening; 6 to 9 by the last 3x3x3; 2 to 5 at a quarter by the widening; 1 to 6
    # by `mixed`; 2 * 1 - 1 = 1 to 2 * 6 + 1 = 13 at half size by `coarse`; 2 * 1 - 1 = 1 to 2 * 13 + 1 = 27 by `down`.
    for axis in range(3):
        assert (seen[:, axis].min(), seen[:, axis].max()) == (1, 27)


def test_kernels_with_channels_last_which_are_faster_give_the_same_cost():
    torch.manual_seed(0)
    layers, cost = CostFilter(16), torch.rand(1, 8, 12, 20)
    nn.init.normal_(layers.last.weight)
    with torch.inference_mode():
        first = layers(cost)
        lay_out(layers, torch.channels_last)
        assert layers.mixed.weight.is_contiguous(memory_format=torch.channels_last_3d)
        last = layers(cost)
    torch.testing.assert_close(last, first, rtol=1e-4, atol=1e-5)
    lay_out(layers, torch.contiguous_format)
    assert layers.mixed.weight.is_contiguous()
