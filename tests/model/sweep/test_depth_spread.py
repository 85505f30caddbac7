"""The spread of depth: by hand, and against a loop over texels and candidates."""

from __future__ import annotations

import math

import pytest
import torch
from golden import fill_golden
from networks import network, preset
from posed import posed_views

from semgs.geometry.plane_sweep import depth_candidates
from semgs.model.layers.network_input import WHOLE, Chunks
from semgs.model.sweep.depth import Depth, Planes


def spread_of(*probabilities: float) -> float:
    """That of one texel whose candidates are at 1 m, e m, e^2 m and so on."""
    depths = torch.arange(len(probabilities), dtype=torch.float64).exp()[None]
    bounds = torch.tensor([[0.5, 100.0]], dtype=torch.float64)
    chances = torch.tensor(probabilities, dtype=torch.float64)[None, :, None, None]
    found = Depth(chances, Planes(depths, bounds)).spread(2)
    assert found.shape == (1, 2, 2)
    assert (found == found[0, 0, 0]).all()
    return found[0, 0, 0].item()


def test_the_spread_is_that_of_the_logarithm():
    assert spread_of(0.0, 1.0, 0.0) == 0
    assert spread_of(0.5, 0.0, 0.5) == pytest.approx(1)
    assert spread_of(0.9, 0.0, 0.1) == pytest.approx(0.6)  # mean 0.2, variance 0.9 * 0.2^2 + 0.1 * 1.8^2 = 0.36


@pytest.mark.parametrize("name", ["small", "text"])
@pytest.mark.parametrize("chunks", [WHOLE, Chunks(heads=1)])
def test_every_pixel_has_the_spread_of_its_texel_in_the_size_of_its_view(name: str, chunks: Chunks):
    model = fill_golden(
        preset("small_plain") if name == "small" else network(paper_heads=True, candidates=8, channels=16)
    )
    model = model.double()
    logits: list[torch.Tensor] = []
    model.colour.depth.regressor.register_forward_hook(lambda module, inputs, output: logits.append(output))
    views = posed_views(3, (29, 37), dtype=torch.float64)
    with torch.inference_mode():
        found = model(views, chunks).depth_spread
    assert found.shape == (3, 29, 37)
    candidates = depth_candidates(views.depth_range, logits[0].shape[1])
    for view, row, column in ((0, 0, 0), (0, 28, 36), (1, 13, 17), (2, 4, 31), (2, 27, 3)):
        chances = logits[0][view, :, row // 4, column // 4].softmax(0).tolist()
        logs = [math.log(depth) for depth in candidates[view].tolist()]
        mean = sum(p * log for p, log in zip(chances, logs, strict=True))
        variance = sum(p * (log - mean) ** 2 for p, log in zip(chances, logs, strict=True))
        assert found[view, row, column].item() == pytest.approx(math.sqrt(variance), rel=1e-9)


def test_the_spread_sends_no_gradient_not_even_where_one_candidate_is_certain():
    chances = torch.tensor([0.0, 1.0])[None, :, None, None].requires_grad_()
    planes = Planes(torch.tensor([[1.0, 2.0]]), torch.tensor([[1.0, 2.0]]))
    assert not Depth(chances, planes).spread(4).requires_grad
