"""Presets: trainings by name, as functions that return settings."""

from __future__ import annotations

from dataclasses import replace

from semgs.model.networks import named_switches
from semgs.objectives.loss_weights import LossWeights
from semgs.training.training_settings import TrainingSettings, describe, differences


def small() -> TrainingSettings:
    """The network for a CPU as it ships, in rooms: small images, and depth as an extra teacher."""
    return TrainingSettings(
        preset="small",
        model="small",
        network=named_switches("small"),
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


def small_plain() -> TrainingSettings:
    """As `small`, with the paper's layers alone: no class backbone, cost filter, cue or fusion."""
    return replace(small(), preset="small_plain", model="small_plain", network=named_switches("small_plain"))


def base() -> TrainingSettings:
    """The paper's network, trained in rooms; batch 2 and random weights, unlike the paper."""
    return TrainingSettings(preset="base", model="base", steps=300_000)


def paper() -> TrainingSettings:
    """The paper's training: scenes of your own (--data), MVSplat's weights (--init), 8 scenes a step as on 4 GPUs with 2 each."""
    return TrainingSettings(
        preset="paper", model="base", steps=300_000, batch=8, learning_rate=2e-4, losses=LossWeights(0.1, 1.0, 0.001),
        data=(), init="",
    )  # fmt: skip


def base_text() -> TrainingSettings:
    """As `paper`, with every sentence of the paper read word by word. It starts from random weights; with --init, MVSplat's fill all but its heads."""
    losses = LossWeights(0.1, 1.0, 0.001, smoothness_over="sum")
    return replace(
        paper(),
        preset="base_text",
        model="base_text",
        network=named_switches("base_text"),
        losses=losses,
        init="random",
    )


PRESETS = {"small": small, "small_plain": small_plain, "base": base, "paper": paper, "base_text": base_text}
"""The trainings that `semgs train` knows by name."""


def preset_changes(settings: TrainingSettings) -> list[str]:
    """How settings differ from the preset that they began as, a sentence for each field."""
    if settings.preset not in PRESETS:
        return []
    changes = differences(settings, PRESETS[settings.preset]())
    return [
        f"{name}: {describe(here)} (preset {settings.preset}: {describe(there)})"
        for name, (here, there) in changes.items()
    ]
