"""Each switch of the paper's ablation, and the paper's heads, trains a step through splatting."""

from __future__ import annotations

from dataclasses import replace

import pytest
import torch
from golden import fill_golden
from networks import network

from semgs.objectives.losses import LossWeights
from semgs.training.state import TrainingState, training_step
from semgs.training.supervision.supervision import make_supervision

TINY = {
    "channels": 16, "cnn_widths": (8, 8, 16), "candidates": 8, "cost_width": 16, "upsampled_channels": 16, "harmonics": 4,
    "refine_width": 16, "refine_levels": 3, "projected_channels": 8, "colour_blocks": 2, "semantic_blocks": 2,
}  # fmt: skip
CAMERA_BLIND = {"camera_aware_colour": False, "camera_aware_semantic": False}


@pytest.mark.long
@pytest.mark.usefixtures("real_rendering")
@pytest.mark.parametrize(
    "switch",
    [
        {},
        {"shared_layers": False},
        {"windows": 1},
        CAMERA_BLIND,
        {"shared_layers": False, "windows": 1, **CAMERA_BLIND},
        {"output_transform": False},
        {"paper_heads": True},
    ],
    ids=lambda switch: ", ".join(switch) or "full",
)
def test_a_step_moves_every_parameter_that_takes_part(batch, settings, switch):
    model = fill_golden(network(**TINY, **switch))  # no norm starts at zero, which would hide what is before it
    before = {name: value.clone() for name, value in model.named_parameters()}
    state = TrainingState.begin(model, make_supervision(settings), 1e-3, settings.average_decay)
    reports = [training_step(state, [batch(0)], settings) for _ in range(2)]
    assert all(report.moved for report in reports)
    still = [name for name, value in model.named_parameters() if torch.equal(value, before[name])]
    # A bias before an instance norm has no effect.
    assert [name for name in still if not name.endswith("downsample.0.bias")] == []


@pytest.mark.usefixtures("real_rendering")
def test_the_loss_weight_of_smoothness_is_the_fourth_switch(batch, settings):
    totals = {}
    for weight in (0.0, 1e3):
        torch.manual_seed(2)
        weights = LossWeights(semantic=0.5, smoothness=weight)
        chosen = replace(settings, losses=weights, depth_weight=0.0)
        state = TrainingState.begin(network(**TINY), make_supervision(chosen), 1e-3, settings.average_decay)
        report = training_step(state, [batch(0)], chosen)
        assert report.smoothness > 0
        totals[weight] = report.total - 0.5 * report.semantic - report.colour
    assert totals[0.0] == pytest.approx(0, abs=1e-6)
    assert totals[1e3] == pytest.approx(1e3 * report.smoothness, rel=1e-3)
