"""Losses of a plane sweep's depth, against numbers worked out by hand."""

from __future__ import annotations

import math

import pytest
import torch
from torch import Tensor

from semgs.objectives.depth_losses import (
    candidate_cross_entropy,
    depth_losses,
    gradient_matching,
    near_edges,
    sharp_loss,
)
from semgs.objectives.loss_weights import DepthLossWeights
from semgs.scene.coarse_depth import CoarseDepth, FinerDepth

BY_INVERSE = torch.tensor([[4, 2, 4 / 3, 1]], dtype=torch.float64)
"""Four candidates from 4 m to 1 m: 1/4, 2/4, 3/4 and 4/4 of inverse depth."""

LINEAR = torch.tensor([[4, 3, 2, 1]], dtype=torch.float64)

PROBABILITIES = torch.tensor([0.1, 0.2, 0.3, 0.4], dtype=torch.float64)


def uniform(generator: torch.Generator, *shape: int) -> Tensor:
    """Numbers from 1 to 4."""
    return 1 + 3 * torch.rand(*shape, generator=generator, dtype=torch.float64)


def cross_entropy(truth: list[float], candidates: Tensor = BY_INVERSE, spacing: str = "inverse") -> float:
    """That of texels in a row, all with the same probabilities."""
    probabilities = PROBABILITIES[None, :, None, None].expand(1, 4, 1, len(truth))
    maps = torch.tensor([[truth]], dtype=torch.float64)
    return float(candidate_cross_entropy(probabilities, candidates, maps, spacing))


def test_a_single_wrong_pixel_costs_its_steps_to_each_neighbour():
    truth = torch.full((1, 2, 3), 2.0, dtype=torch.float64)
    depths = truth.clone()
    depths[0, 0, 1] = 2 * math.e  # an error of 1, in the middle of the upper row
    # Two steps along the row and one down, over six pixels; the coarser scales do not see it.
    assert float(gradient_matching(depths, truth)) == pytest.approx(3 / 6)
    truth[0, 0, 0] = 0  # no step to a pixel without depth, nor does it count
    assert float(gradient_matching(depths, truth)) == pytest.approx(2 / 5)
    truth[0, 0, 1] = 0
    assert float(gradient_matching(depths, truth)) == 0


def test_an_error_that_rises_by_a_tenth_a_pixel_costs_its_step_at_each_scale():
    truth = torch.full((1, 5, 9), 3.0, dtype=torch.float64)
    depths = truth * torch.exp(0.1 * torch.arange(9, dtype=torch.float64))
    # Of 9, 5, 3 and 2 columns at strides 1, 2, 4 and 8 each but one has a step, of so many tenths.
    by_hand = 0.1 * (1 * 8 / 9 + 2 * 4 / 5 + 4 * 2 / 3 + 8 * 1 / 2)
    assert float(gradient_matching(depths, truth)) == pytest.approx(by_hand)
    assert float(gradient_matching(depths.mT, truth.mT)) == pytest.approx(by_hand)


def test_a_wrong_scale_has_no_wrong_gradients_but_an_error_of_log_depth():
    truth = uniform(torch.Generator().manual_seed(0), 2, 8, 12)
    coarse = CoarseDepth(1.5 * truth, torch.full((2, 4, 2, 3), 0.25).double(), BY_INVERSE.expand(2, 4), "inverse")
    found = depth_losses(coarse, truth)
    assert float(found.gradients) == pytest.approx(0, abs=1e-12)
    assert float(found.log) == pytest.approx(math.log(1.5))
    assert float(found.distribution) == pytest.approx(math.log(4))  # undecided between four
    assert float(found.total) == pytest.approx(1.3 * math.log(1.5) + 0.1 * math.log(4))
    weighted = depth_losses(coarse, truth, DepthLossWeights(log=2.0, gradients=7.0, distribution=3.0))
    assert float(weighted.total) == pytest.approx(2 * math.log(1.5) + 3 * math.log(4))


def test_a_true_depth_is_divided_between_its_two_candidates_in_their_own_spacing():
    assert cross_entropy([4.0]) == pytest.approx(-math.log(0.1))
    assert cross_entropy([1.0]) == pytest.approx(-math.log(0.4))
    # 1 / 1.6 = 0.625 is midway between 1 / 2 and 3 / 4; 1 / 3.2 = 0.3125 is a quarter of the way from 1 / 4 to 1 / 2.
    assert cross_entropy([1.6]) == pytest.approx(-(math.log(0.2) + math.log(0.3)) / 2)
    assert cross_entropy([3.2]) == pytest.approx(-0.75 * math.log(0.1) - 0.25 * math.log(0.2))
    assert cross_entropy([3.2], LINEAR, "linear") == pytest.approx(-0.2 * math.log(0.1) - 0.8 * math.log(0.2))


def test_what_is_unknown_or_beyond_the_candidates_is_no_texel_of_the_mean():
    assert cross_entropy([1.0, 0.0, 0.9, 4.1, 4.0]) == pytest.approx(-(math.log(0.4) + math.log(0.1)) / 2)
    assert cross_entropy([0.0, 5.0]) == 0


def test_a_texel_has_the_depth_of_the_pixel_at_its_centre_and_no_mean_over_an_edge():
    truth = torch.full((1, 7, 9), 4.0, dtype=torch.float64)
    truth[0, 2, 2] = truth[0, 6, 2] = 1.0
    truth[0, 2, 6] = 0
    probabilities = PROBABILITIES[None, :, None, None].expand(1, 4, 2, 2)
    coarse = CoarseDepth(truth.clamp(min=1), probabilities, BY_INVERSE, "inverse")
    # Centres: 1 m, none, 1 m, 4 m.
    assert float(depth_losses(coarse, truth).distribution) == pytest.approx(-(2 * math.log(0.4) + math.log(0.1)) / 3)


def test_every_view_counts_alike_and_one_without_depth_as_zero():
    generator = torch.Generator().manual_seed(1)
    truth = uniform(generator, 3, 8, 12)
    truth[0, :5], truth[2] = 0, 0
    logits = torch.randn(3, 4, 2, 3, generator=generator, dtype=torch.float64)
    coarse = CoarseDepth(uniform(generator, 3, 8, 12), logits.softmax(1), BY_INVERSE.expand(3, 4), "inverse")
    together = depth_losses(coarse, truth)
    alone = [
        depth_losses(
            CoarseDepth(coarse.depths[k : k + 1], coarse.probabilities[k : k + 1], BY_INVERSE, "inverse"), truth[k : k + 1]
        )
        for k in range(3)
    ]  # fmt: skip
    assert float(alone[2].total) == 0
    for name in ("log", "gradients", "distribution", "total"):
        mean = sum(float(getattr(one, name)) for one in alone) / 3
        assert float(getattr(together, name)) == pytest.approx(mean, rel=1e-12)


def total_of(truth: Tensor, depths: Tensor, logits: Tensor) -> Tensor:
    """The loss of depths and of the distributions that logits stand for."""
    return depth_losses(
        CoarseDepth(depths, logits.softmax(-3), BY_INVERSE.expand(len(truth), 4), "inverse"), truth
    ).total


def test_gradients_are_those_of_finite_differences_and_holes_have_none():
    generator = torch.Generator().manual_seed(2)
    truth = uniform(generator, 2, 6, 7)
    truth[torch.rand(2, 6, 7, generator=generator) < 0.3] = 0
    depths = uniform(generator, 2, 6, 7).requires_grad_()
    logits = torch.randn(2, 4, 1, 2, generator=generator, dtype=torch.float64).requires_grad_()
    assert torch.autograd.gradcheck(lambda d, p: total_of(truth, d, p), (depths, logits), eps=1e-7, atol=1e-7)
    (gradient,) = torch.autograd.grad(total_of(truth, depths, logits), depths)
    assert (gradient[truth == 0] == 0).all()
    assert (gradient[truth > 0] != 0).any()


def test_gradients_stay_finite_where_the_truth_has_no_probability_left():
    truth = torch.full((1, 4, 4), 4.0)
    depths = torch.ones(1, 4, 4, requires_grad=True)
    logits = torch.tensor([0.0, 0.0, 0.0, 200.0])[None, :, None, None].clone().requires_grad_()
    total = total_of(truth, depths, logits)
    assert torch.isfinite(total)
    assert all(torch.isfinite(one).all() for one in torch.autograd.grad(total, (depths, logits)))


def step(columns: int) -> Tensor:
    """True depth of one row: 2 m in the left half, 4 m in the right half."""
    return torch.tensor([[2.0] * (columns // 2) + [4.0] * (columns // 2)], dtype=torch.float64)[None]


def test_six_pixels_beyond_the_two_of_a_step_are_near_an_edge():
    near = near_edges(step(40))[0, 0]
    assert near.nonzero()[:, 0].tolist() == list(range(13, 27))  # the pixels 19 and 20, and six more on each side
    slope = 2 * torch.exp(0.04 * torch.arange(40.0))[None, None]  # 0.08 over three pixels
    assert not near_edges(slope).any()
    assert near_edges(slope.square()).all()  # 0.16
    unknown = step(40)
    unknown[..., 20:] = 0
    assert not near_edges(unknown).any()


def test_a_wrong_pixel_near_an_edge_costs_three_times_as_much():
    for column, weight in ((20, 3), (2, 1)):
        depths = step(40)
        depths[0, 0, column] *= math.exp(0.5)
        pixels = 26 + 3 * 14
        # The window of 31 pixels around column 2 has columns 0 to 17, of which 0 to 12 are away from the edge: their mean error is 0.5 / 13.
        # Each pixel whose window has the wrong one is compared with its own mean.
        shifts = {c: 0.0 for c in range(40)}
        if column == 2:
            for c in range(40):
                window = [k for k in range(c - 15, c + 16) if 0 <= k < 40 and not 13 <= k <= 26]
                shifts[c] = 0.5 / len(window) if 2 in window else 0.0
        weights = [3 if 13 <= c <= 26 else 1 for c in range(40)]
        errors = [abs((0.5 if c == column else 0.0) - shifts[c]) for c in range(40)]
        mean = sum(w * e for w, e in zip(weights, errors, strict=True)) / pixels
        if column == 20:
            assert mean == pytest.approx(3 * 0.5 / pixels)
        steps = float(gradient_matching(depths, step(40)))
        assert float(sharp_loss(depths, step(40))) == pytest.approx(mean + 0.5 * steps), weight


def test_surfaces_that_are_too_far_as_a_whole_cost_nothing():
    assert float(sharp_loss(1.3 * step(40), step(40))) == pytest.approx(0, abs=1e-12)
    depths = step(40)
    depths[..., 16:24] = 3.0  # a blurred edge costs, although as many pixels are too far as too near
    assert float(sharp_loss(depths, step(40))) > 0.1


def test_the_shift_of_the_truth_has_no_gradient():
    depths = (1.2 * step(40)).requires_grad_()
    with torch.no_grad():
        depths[..., 3] += 0.1
    sharp_loss(depths, step(40)).backward()
    # Column 10 is in the windows of its neighbours, whose shift would pass a gradient on; without one, it learns from itself alone: weight 1
    # of 68, below its shifted truth. Gradient matching pulls it nowhere, as its neighbours have the same error.
    assert float(depths.grad[0, 0, 10] * depths[0, 0, 10].detach()) == pytest.approx(-1 / 68)


def test_sharp_depth_joins_the_total_by_its_weight_and_needs_convex_upsampling():
    truth = step(40).expand(1, 8, 40).clone()
    blurred = truth.clone()
    blurred[..., 16:24] = 3.0
    coarse = CoarseDepth(
        truth, torch.full((1, 4, 2, 10), 0.25).double(), BY_INVERSE, "inverse", FinerDepth(blurred, truth)
    )
    weights = DepthLossWeights(log=0.0, gradients=0.0, distribution=0.0, sharp=2.0)
    found = depth_losses(coarse, truth, weights)
    assert float(found.sharp) == pytest.approx(float(sharp_loss(blurred, truth)))
    assert float(found.total) == pytest.approx(2 * float(found.sharp))
    assert float(depth_losses(coarse, truth).sharp) == 0
    without = CoarseDepth(truth, coarse.probabilities, BY_INVERSE, "inverse")
    with pytest.raises(ValueError, match="needs a network with convex depth upsampling"):
        depth_losses(without, truth, weights)
