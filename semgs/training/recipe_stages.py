"""The recipe of the included weights: three trainings, one after the other, each starting from the weights of the one before."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from pathlib import Path

from semgs.objectives.loss_weights import LossWeights
from semgs.training.data.augmentation_settings import Augmentation
from semgs.training.presets import PRESETS
from semgs.training.training_settings import WEIGHTS, TrainingSettings

STAGES = ("classes", "depth", "joint")
"""The stages of a recipe, in order."""

MODELS = ("small", "base")
"""The networks that have one. Only `small` was trained by it."""


@dataclass(frozen=True)
class Start:
    """What all stages of a recipe share, or start from.

    Attributes:
        model: one of `MODELS`.
        data, validation, assets, seed: as in `TrainingSettings`; stage k has seed + k.
        init: weights whose colour and depth to start from; empty for the included ones of `small` and random ones of `base`.
        backbone: published MobileNetV2 weights for the class backbone; empty for random ones.
        teacher: folder of a teacher's class probabilities; empty for none.
        size: image (height, width) of the last part of each stage [px].
        share: of each stage's steps; 0.05 is a quick trial.
    """

    model: str = "small"
    data: tuple[str, ...] = TrainingSettings.data
    validation: str = TrainingSettings.validation
    assets: tuple[str, ...] = ()
    seed: int = 0
    init: str = ""
    backbone: str = ""
    teacher: str = ""
    size: tuple[int, int] = (240, 320)
    share: float = 1.0

    def __post_init__(self) -> None:
        if self.model not in MODELS:
            raise ValueError(f"model is {self.model!r}; expected one of {', '.join(MODELS)}")
        if not 0 < self.share <= 1:
            raise ValueError(f"share is {self.share}; expected above 0, at most 1")


def folder(out: Path, stage: str) -> Path:
    """The run folder of a stage: OUT/1_classes, OUT/2_depth, OUT/3_joint."""
    return out / f"{STAGES.index(stage) + 1}_{stage}"


def weights_of(out: Path, stage: str) -> Path:
    """The weights that a finished stage leaves."""
    return folder(out, stage) / WEIGHTS


def settings_of(stage: str, start: Start, out: Path) -> TrainingSettings:
    """The settings of one stage.

    Args:
        stage: one of `STAGES`.
        start: what the stages share.
        out: the folder that holds the run folders.
    """
    place = STAGES.index(stage)
    first = start.init or ("small" if start.model == "small" else "random")
    before = str(weights_of(out, STAGES[place - 1])) if place else first
    common = replace(
        PRESETS[start.model](), preset="", data=start.data, validation=start.validation, assets=start.assets, seed=start.seed + place,
        init=before, size=start.size, context_targets=False, warmup=0.05,
    )  # fmt: skip
    made = _MAKERS[stage](common, start)
    steps = max(1, round(made.steps * start.share))
    return replace(made, steps=steps, validate_every=max(1, min(made.validate_every, steps)))


def _classes(common: TrainingSettings, start: Start) -> TrainingSettings:
    """What things look like: single images, the first part of the steps at half the size."""
    return replace(
        common, supervision="pictures", steps=4000, batch=16, half_size=0.6,
        learning_rate=2e-3, clip=2.0, average_decay=0.998, class_weights="inverse_fourth_root_frequency",
        network=replace(common.network, class_backbone=True, class_fusion=True), backbone=start.backbone, teacher=start.teacher,
        augmentation=Augmentation(colour=0.5, crop=0.4, flip=True, roll=10.0, camera=1.0),
        validate_every=500, validation_scenes=48,
    )  # fmt: skip


def _depth(common: TrainingSettings, start: Start) -> TrainingSettings:
    """How far things are: two to four views against true depth, nothing rendered; classes stay."""
    return replace(
        common, supervision="depth", steps=2500, batch=4, contexts=(2, 4), targets=1, half_size=0.6,
        learning_rate=5e-4, average_decay=0.99, network=replace(common.network, cost_filter=16, depth_cue=True),
        augmentation=Augmentation(colour=0.3, crop=0.6, flip=True, camera=0.4),
        validate_every=500, validation_scenes=24,
    )  # fmt: skip


def _joint(common: TrainingSettings, start: Start) -> TrainingSettings:
    """Colour and opacity meet the new depth: rendered views of consecutive frames; classes and the plane sweep stay."""
    return replace(
        common, steps=480, batch=2, contexts=(2, 4), targets=2, frames="consecutive", learning_rate=5e-4, average_decay=0.98,
        sweep_rate=0.0, class_rate=0.0, losses=LossWeights(semantic=0.0, smoothness=0.0), depth_weight=0.3,
        context_targets=True, augmentation=Augmentation(colour=0.2, flip=True),
        validate_every=160, validation_scenes=12,
    )  # fmt: skip


_MAKERS: dict[str, Callable[[TrainingSettings, Start], TrainingSettings]] = {
    "classes": _classes,
    "depth": _depth,
    "joint": _joint,
}
