"""The rows of an ablation: the training settings of the paper's five variants, whole or of the semantic branch alone."""

from __future__ import annotations

from dataclasses import dataclass, replace
from pathlib import Path
from typing import Literal

from semgs.model.switches import Switches
from semgs.objectives.loss_weights import LossWeights
from semgs.training.training_settings import TrainingSettings

AblationStage = Literal["whole", "semantic"]

BASE_STAGES = ("depth", "colour")
"""The trainings of the base that all rows of a semantic ablation share, in order."""

BASE_SHARES = (0.625, 0.125)
"""Their steps, as shares of those of a row."""

EQUAL_GRADIENT = 7000.0
"""Times the paper's smoothness weight, at which the mean over pixels has about the gradient of the cross-entropy in the semantic branch."""


@dataclass(frozen=True)
class AblationRow:
    """A variant in the paper's table: the parts of the variant above it, and one more.

    Attributes:
        name: of its folder.
        title: what it adds; for the paper's rows, the part by the paper's name.
        above: the name of the variant that it adds this to; "" for the first.
        shared_layers, windows, camera_aware: parts of its network.
        smoothness: times the weight of the smoothness term in the loss; 0 for none.
        smoothness_over: what the term is, as in `LossWeights`; None is as in the settings.
    """

    name: str
    title: str
    above: str = ""
    shared_layers: bool = True
    windows: bool = True
    camera_aware: bool = True
    smoothness: float = 1.0
    smoothness_over: Literal["pixels", "sum"] | None = None

    @property
    def parts(self) -> tuple[bool, ...]:
        """The four parts in the order of the paper's columns."""
        return self.shared_layers, self.windows, self.camera_aware, self.smoothness > 0


ROWS = (
    AblationRow("none", "none", shared_layers=False, windows=False, camera_aware=False, smoothness=0.0),
    AblationRow("shared", "+ Sh-Layer", "none", windows=False, camera_aware=False, smoothness=0.0),
    AblationRow("windows", "+ Sw-Trans", "shared", camera_aware=False, smoothness=0.0),
    AblationRow("camera", "+ C-Inj", "windows", smoothness=0.0),
    AblationRow("full", "+ Sm-Loss", "camera"),
)
"""From none of the parts to the full method, in the paper's order."""

SEMANTIC_ROWS = (
    *ROWS,
    AblationRow("smoothness_sum", "+ Sm-Loss, summed", "camera", smoothness_over="sum"),
    AblationRow(
        "smoothness_equal", "+ Sm-Loss, equal gradient", "camera", smoothness=EQUAL_GRADIENT, smoothness_over="pixels"
    ),
)
"""These, and the smoothness loss as the paper's formula reads, and as strong as the cross-entropy."""


def rows_of(stage: AblationStage) -> tuple[AblationRow, ...]:
    """The rows of a stage, in order."""
    return SEMANTIC_ROWS if stage == "semantic" else ROWS


def row_settings(settings: TrainingSettings, row: AblationRow, seed: int) -> TrainingSettings:
    """The settings of a variant that is trained whole: those of the full method with only the variant's parts, and this seed.

    Raises:
        ValueError: the full method itself lacks a part, so two variants would be equal.
    """
    windows = settings.network.windows if row.windows else 1
    network = replace(settings.network, windows=windows, camera_aware_colour=row.camera_aware)
    return _with_parts(settings, row, seed, network)


def semantic_row_settings(settings: TrainingSettings, row: AblationRow, seed: int, base: Path) -> TrainingSettings:
    """The settings of a variant whose semantic branch alone is trained, by labels; depth, colour and shared layers are those of the base.

    Args:
        settings: of the full method.
        row: the variant; its parts are those of its semantic branch.
        seed: of the branch's random weights and of the samples.
        base: weights with depth and colour.

    Raises:
        ValueError: the full method itself lacks a part, so two variants would be equal.
    """
    alone = replace(settings, supervision="labels", init=str(base), semantic_branch="drawn", shared_rate=0.0)
    return _with_parts(alone, row, seed, replace(settings.network, windows_semantic=0 if row.windows else 1))


def base_settings(settings: TrainingSettings, stage: str, before: Path | None) -> TrainingSettings:
    """The settings of a training of the base, which has the paper's colour branch and learns no classes.

    First depth learns by itself, from true depth; then colour and opacity learn from rendered views, while depth stays.

    Args:
        settings: of the full method.
        stage: one of `BASE_STAGES`.
        before: the weights of the stage before; None for the first.

    Raises:
        ValueError: the stage cannot have these settings.
    """
    steps = max(1, round(settings.steps * BASE_SHARES[BASE_STAGES.index(stage)]))
    common = replace(
        settings, init=settings.init if before is None else str(before), steps=steps, validate_every=min(settings.validate_every, steps),
        supervision="rendered", losses=LossWeights(semantic=0.0, smoothness=0.0), class_weights=None, class_rate=0.0,
    )  # fmt: skip
    if stage == "depth":
        return replace(common, supervision="depth", average_decay=0.99)
    return replace(common, sweep_rate=0.0, depth_weight=0.3, context_targets=True, average_decay=0.98)


def _with_parts(settings: TrainingSettings, row: AblationRow, seed: int, network: Switches) -> TrainingSettings:
    """The settings with a variant's parts and seed; in `network`, those that only one of the two stages changes are already changed."""
    _check_full(settings)
    network = replace(network, shared_layers=row.shared_layers, camera_aware_semantic=row.camera_aware)
    return replace(settings, network=network, losses=_losses(settings.losses, row), seed=seed)


def _check_full(settings: TrainingSettings) -> None:
    """Refuse settings of which a part of the full method is missing."""
    full = settings.network
    lacks = [
        title
        for title, there in {
            "Sh-Layer": full.shared_layers,
            "Sw-Trans": full.windows > 1 and full.windows_semantic != 1,
            "C-Inj": full.camera_aware_colour and full.camera_aware_semantic,
            "Sm-Loss": settings.losses.smoothness > 0,
        }.items()
        if not there
    ]
    if lacks:
        raise ValueError(f"the full method lacks {', '.join(lacks)}; an ablation starts from all four parts")


def _losses(full: LossWeights, row: AblationRow) -> LossWeights:
    """The weights of a variant's loss."""
    over = row.smoothness_over or full.smoothness_over
    return replace(full, smoothness=full.smoothness * row.smoothness, smoothness_over=over)
