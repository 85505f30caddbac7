"""Presets: trainings by name, as functions that return settings."""

from __future__ import annotations

from semgs.objectives.weights import LossWeights
from semgs.training.settings import TrainingSettings


def small() -> TrainingSettings:
    """The network for a CPU, in rooms: small pictures, more scenes a step, and depth as an extra teacher."""
    return TrainingSettings(
        model="small",
        steps=12_000,
        batch=2,
        size=(96, 128),
        contexts=(2, 3),
        targets=2,
        context_targets=True,
        learning_rate=1e-3,
        warmup=0.05,
        average_decay=0.998,
        losses=LossWeights(),
        depth_weight=0.1,
    )


def base() -> TrainingSettings:
    """The paper's network and the paper's numbers where it gives them, in rooms."""
    return TrainingSettings(model="base", steps=300_000)


PRESETS = {"small": small, "base": base}
"""The trainings that `semgs train` knows by name."""
