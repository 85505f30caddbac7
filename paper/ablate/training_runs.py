"""Several trainings by one command: each is skipped if it is finished, else trained or resumed in the time that is left."""

from __future__ import annotations

import time
from dataclasses import replace
from pathlib import Path

from paper.ablate.train_apart import train_apart
from semgs.run.usage_errors import UsageError, what_the_user_gave
from semgs.training.run.execution import Execution
from semgs.training.training_settings import TrainingSettings


def deadline(minutes: float | None) -> float | None:
    """When `minutes` from now will have passed, by the clock of `train_or_resume`; None for never."""
    return None if minutes is None else time.monotonic() + 60 * minutes


def train_or_resume(
    title: str, run: Path, settings: TrainingSettings, execution: Execution, ends: float | None = None
) -> bool:
    """Train into a run folder until it is finished or time is up. Returns whether it is finished.

    Args:
        title: printed before it starts.
        run: the run folder; new, empty, or one with these settings.
        settings: what to train.
        execution: how to run it; its `minutes` do not count.
        ends: when to stop, from `deadline`.

    Raises:
        UsageError: the settings are invalid, training failed, or an extra is not installed.
        InputError: the folder is another run, or the folder, the data or the initial weights cannot be used.
    """
    from rich.console import Console

    from semgs.training.loop import train
    from semgs.training.run.run_folder import WEIGHTS, claim_folder, extend_run, has_begun, is_finished

    with what_the_user_gave():
        settings.check_complete()
    claim_folder(run, settings)
    if has_begun(run):
        extend_run(run, settings)  # without the lock, as all processes of a training come here at the same time
    if is_finished(run) and (run / WEIGHTS).is_file():
        return True
    left = None if ends is None else (ends - time.monotonic()) / 60
    if left is not None and left <= 0:
        return False
    console = Console(stderr=True, highlight=False)
    console.print(title, markup=False, soft_wrap=True)
    execution = replace(execution, minutes=left)
    if execution.devices > 1:
        train_apart(run, settings, execution)
        return is_finished(run)
    try:
        return train(settings, run, execution, console=console).finished
    except (FloatingPointError, ImportError) as error:
        raise UsageError(str(error)) from error
