"""The data of a training, from all of its settings."""

from __future__ import annotations

from collections.abc import Iterable
from pathlib import Path

from semgs.data.views import Batch
from semgs.training.data.batches import Portion, training_batches, validation_batches
from semgs.training.data.data_check.data_check import RunData, check_data
from semgs.training.data.teacher import Teacher
from semgs.training.training_settings import TrainingSettings


def run_data(settings: TrainingSettings, run: Path) -> RunData:
    """The checked data of a run; `run` is its folder."""
    return check_data(settings, settings, settings.init, run)


def run_portions(
    settings: TrainingSettings, run: Path, start: int = 0, workers: int = 0, data: RunData | None = None
) -> Iterable[Portion]:
    """The portions of a run from a step on; `run` is its folder."""
    teacher = Teacher.open(settings.teacher) if settings.teacher else None
    return training_batches(
        settings, data or run_data(settings, run), settings.steps, start, pool=run / "rooms", workers=workers,
        single_images=settings.single_images, teacher=teacher,
    )  # fmt: skip


def run_validation(settings: TrainingSettings, run: Path) -> list[Batch]:
    """The batches that a run is validated on; `run` is its folder."""
    return validation_batches(settings, run_data(settings, run).classes, settings.single_images)
