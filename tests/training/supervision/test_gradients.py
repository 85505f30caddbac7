"""The gradient of the whole loss, through splatting, cost volume and attention, against finite differences in float64."""

from __future__ import annotations

import pytest
import torch
from golden import fill_golden
from kinks import Kinks
from networks import network
from posed import posed_cameras, posed_views

from semgs.data.tables.classes import IGNORE, SCANNET20
from semgs.data.views import Views
from semgs.model.semgs import SemGS
from semgs.objectives.loss_weights import LossWeights
from semgs.objectives.losses import Losses, losses
from semgs.rendering.render import render

SIZE = (16, 32)
STEP = 1e-7
SETTINGS = {
    "channels": 16, "cnn_widths": (8, 8, 16), "candidates": 8, "cost_width": 16, "upsampled_channels": 16, "harmonics": 4,
    "refine_width": 16, "refine_levels": 3, "projected_channels": 8, "colour_blocks": 2, "semantic_blocks": 2,
    "gaussian_stride": 2,
}  # fmt: skip
SEED = 0


def target() -> Views:
    """One view between the contexts, with labels in bands, some of them ignored."""
    generator = torch.Generator().manual_seed(SEED + 2)
    cameras = posed_cameras(3, SIZE, seed=SEED, spread=0.15)[2:]
    labels = (torch.arange(SIZE[1]) // 7)[None].repeat(SIZE[0], 1).to(torch.uint8)
    labels[:3] = 9
    labels[5, 4:9] = IGNORE
    images = torch.rand(1, 3, *SIZE, generator=generator, dtype=torch.float64)
    bounds = torch.tensor([[0.5, 10.0]], dtype=torch.float64)
    return Views(images, cameras, bounds, labels=labels[None], classes=SCANNET20)


@pytest.fixture(scope="module", params=[False, True], ids=["mvsplat heads", "paper heads"])
def model(request) -> SemGS:
    return fill_golden(network(**SETTINGS, paper_heads=request.param)).double()


def terms(model: SemGS, context: Views, truth: Views) -> Losses:
    gaussians = model(context).gaussians
    rendering = render(gaussians, truth.cameras, near=0.5, backend="reference")
    # Weights that make the terms alike in size, so that none is lost beside the others.
    return losses(rendering, truth, LossWeights(semantic=0.1, colour=1.0, smoothness=0.5))


@pytest.mark.long
def test_the_gradient_of_the_whole_loss_is_that_of_finite_differences(model: SemGS):
    """Along a random direction in the parameters of each part; nothing crosses a kink on the way, nor half-way to one."""
    context = posed_views(2, SIZE, seed=SEED, dtype=torch.float64)
    truth = target()
    model.zero_grad()
    with Kinks() as here:
        result = terms(model, context, truth)
    assert min(result.semantic, result.smoothness, result.colour) > 1e-3
    result.total.backward()
    for name, part in model.named_children():
        parameters = list(part.parameters())
        generator = torch.Generator().manual_seed(3)
        direction = [torch.randn(p.shape, generator=generator, dtype=torch.float64) for p in parameters]
        length = torch.stack([d.square().sum() for d in direction]).sum().sqrt()
        slope = float(sum((d * p.grad).sum() for d, p in zip(direction, parameters, strict=True)) / length)
        ends = []
        for sign in (1, -1):
            with torch.no_grad():
                start = [p.clone() for p in parameters]
                for p, d in zip(parameters, direction, strict=True):
                    p += sign * STEP / length * d
                with Kinks() as there:
                    ends.append(float(terms(model, context, truth).total))
                for p, s in zip(parameters, start, strict=True):
                    p.copy_(s)
            for a, b in zip(here.distances, there.distances, strict=True):
                assert (a.abs() >= 2 * (b - a).abs()).all(), name
        measured = (ends[0] - ends[1]) / (2 * STEP)
        assert abs(slope) > 1e-4, name
        assert measured == pytest.approx(slope, rel=1e-5), name
