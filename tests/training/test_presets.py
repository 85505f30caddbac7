"""The numbers of the paper's training."""

from __future__ import annotations

import torch

from semgs.objectives.weights import LossWeights
from semgs.training.presets import base
from semgs.training.state import TrainingState


def test_base_trains_with_the_papers_numbers(network):
    settings = base()
    assert (settings.learning_rate, settings.steps, settings.batch) == (2e-4, 300_000, 2)
    assert settings.losses == LossWeights(semantic=0.1, colour=1.0, smoothness=0.001)
    assert settings.contexts == (2, 4)
    assert settings.class_weights is None
    assert settings.depth_weight == 0
    assert not settings.context_targets
    state = TrainingState.begin(network(), settings.learning_rate, settings.average_decay)
    assert type(state.optimizer) is torch.optim.Adam
    assert state.optimizer.defaults["weight_decay"] == 0
