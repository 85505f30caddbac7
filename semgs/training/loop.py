"""The training loop.

    RUN/settings.json          the settings of the training
    RUN/network.json           the settings of the network
    RUN/data.json              the scenes, their class counts and terms
    RUN/log.jsonl              losses, speed and validations, one JSON object per line
    RUN/tensorboard/*          the same for TensorBoard
    RUN/validation/*.png       strips of images: image, truth, classes, truth, depth, truth
    RUN/checkpoints/*          the last three checkpoints and the best
    RUN/rooms/*                rooms that several samples share, if the settings ask for that
    RUN/weights.safetensors    the averaged weights, written at the end of each session; best.safetensors: those of the best validation

The same call starts and resumes a run. With more `steps` the run becomes longer, and from then on its learning rate is that of the
longer run. Step k sees batch k, which depends on the seed and k alone: on a CPU a resumed run gives exactly the same result as an
uninterrupted one. On CUDA gradients are summed in no fixed order. Several processes share the scenes of each step; only the first one
reads and writes RUN.
"""

from __future__ import annotations

import math
import time
from collections.abc import Iterable, Sequence
from contextlib import nullcontext
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import torch
from rich.console import Console

from semgs.data.views import Batch
from semgs.files.atomic import remove_parts
from semgs.files.errors import input_error
from semgs.files.images.pictures import write_png
from semgs.rooms.assets.lock import verify
from semgs.training.data.batches import Portion, surveyed, training_batches, validation_batches
from semgs.training.engine import launched
from semgs.training.presets import from_preset
from semgs.training.run.checkpoints import best_checkpoint, newest_checkpoint, save_checkpoint
from semgs.training.run.execution import Execution
from semgs.training.run.faults import TOLERATED_IN_A_ROW, BadScenes, broken_down
from semgs.training.run.log import RunLog, tell
from semgs.training.run.run_folder import (
    BEST,
    SETTINGS,
    WEIGHTS,
    alone,
    claim,
    export_weights,
    hold_assets,
    network,
    prolong,
)
from semgs.training.run.session import Session, Stopped, timed
from semgs.training.state import TrainingState
from semgs.training.step import training_step
from semgs.training.supervision.supervision import rate_shares, supervision_of
from semgs.training.training_settings import TrainingSettings


@dataclass(frozen=True)
class Feed:
    """What the loop is fed with.

    Attributes:
        batches: the portion of each step, from the state's own step on.
        validation: batches to validate with; empty for no validation.
        scenes: number of scenes in folders, bad ones included.
        bad: those known to be bad: path and reason.
    """

    batches: Iterable[Portion]
    validation: Sequence[Batch] = ()
    scenes: int = 0
    bad: Sequence[tuple[str, str]] = ()


@dataclass(frozen=True)
class Outcome:
    """How a session ended.

    Attributes:
        step: steps taken, over all sessions.
        finished: whether these are all; if not, the same call resumes from here.
        skipped: steps without a finite gradient.
    """

    step: int
    finished: bool
    skipped: int


def train(
    settings: TrainingSettings,
    out: Path,
    execution: Execution | None = None,
    *,
    console: Console | None = None,
) -> Outcome:
    """Train, or resume training, into a run folder.

    Args:
        settings: what to compute; a folder with a run of other settings is refused, but one of fewer steps becomes longer.
        out: the run folder.
        execution: how to run it; None is the default. A run may resume on another device, but not to the same bits.
        console: where the first process shows progress; None shows nothing.

    Raises:
        ValueError: the folder is a run with other settings, a required setting is missing, or a step cannot be shared equally.
        InputError: the folder contains something else or only damaged checkpoints, another process trains into it, the data, assets or
            initial weights cannot be used, or its checkpoints are of another network.
        ImportError: training or its rooms need an extra that is not installed.
        FloatingPointError: ten steps in a row had no finite gradient; the last batch is saved in the run folder.
    """
    began = time.monotonic()
    execution = execution or Execution()
    settings.check_whole()
    execution.share().check(settings.batch)
    for folder in settings.assets:
        verify(folder)
    claim(out, settings)
    hold_assets(out, settings.assets)
    fabric = launched(execution)
    console = console if fabric.is_global_zero else None
    tell(console, from_preset(settings))
    with alone(out) if fabric.is_global_zero else nullcontext():
        if fabric.is_global_zero:
            prolong(out, settings)
            if fabric.world_size == 1:  # other processes of a training write without the lock
                for part in (out, out / "checkpoints", out / "validation"):
                    remove_parts(part, out / SETTINGS)
        model = network(out, settings)
        data = surveyed(settings, out)
        where = execution.device if fabric.world_size == 1 else f"{execution.device}, {fabric.world_size} processes"
        tell(console, [*data.notes, f"{settings.model}: {model.origin}", f"on {where}"])
        supervision = supervision_of(replace(settings, class_weights=data.class_weights))
        state = TrainingState.begin(
            model.to(fabric.device), supervision, settings.learning_rate, settings.average_decay, fabric,
            shares=rate_shares(model, settings),
        )  # fmt: skip
        resume(state, out, console)
        share = execution.share(fabric.global_rank)
        feed = Feed(
            training_batches(settings, data, state.step, execution.workers, out / "rooms", share),
            validation_batches(settings, data) if fabric.is_global_zero else [],
            data.scenes,
            data.bad,
        )
        left = None if execution.minutes is None else execution.minutes - (time.monotonic() - began) / 60
        outcome = fit(state, settings, out, feed, Session(left, execution.save_minutes, state.seconds), console)
        stepped = outcome.step > 0  # without a step there is no checkpoint
        if fabric.is_global_zero and stepped:
            export_weights(out, out / WEIGHTS)
            if best_checkpoint(out / "checkpoints") is not None:
                export_weights(out, out / BEST, best=True)
        weights = f"; weights: {out / WEIGHTS}" if stepped else ""
        how = f"step {outcome.step} of {settings.steps}, {outcome.skipped} skipped{weights}"
        tell(console, [how, *([] if outcome.finished else ["repeat the command to resume"])])
        return outcome


def resume(state: TrainingState, out: Path, console: Console | None = None) -> None:
    """Restore the state from the run's newest intact checkpoint, if there is one.

    Raises:
        InputError: the checkpoint is of another network.
    """
    folder = out / "checkpoints"
    checkpoint = state.fabric.broadcast(newest_checkpoint(folder) if state.fabric.is_global_zero else None)
    if checkpoint is None:
        return
    advice = "another version of semgs wrote it; resume with that version, or name a new folder"
    with input_error(folder, "checkpoints of this network", advice=advice):
        state.restore(checkpoint.tensors, checkpoint.numbers)
    tell(
        console,
        [*(f"{record}: damaged, skipped" for record in checkpoint.damaged), f"resuming from step {state.step}"],
    )


def fit(
    state: TrainingState,
    settings: TrainingSettings,
    out: Path,
    feed: Feed,
    session: Session,
    console: Console | None = None,
) -> Outcome:
    """The loop itself: train from the state's own step to the last one, or until the session is over."""
    fabric, folder, first = state.fabric, out / "checkpoints", state.step
    leads, owed = fabric.is_global_zero, state.validation_due
    with (
        RunLog(out if leads else None, state.step, settings.steps, console) as log,
        session,
    ):
        known = BadScenes(feed.scenes, log.say, feed.bad)
        if feed.validation and state.step == 0 and settings.init != "random":
            state.validation_due = True  # how good the initial weights are
        _check(state, feed.validation, out, log, session)
        for portion, waited in () if _any(fabric, session.stopping) else timed(feed.batches):
            if portion.failure is not None:
                raise portion.failure
            known.add(portion.bad)
            report = training_step(state, portion.pieces, settings)
            state.seconds = session.stepped()
            log.step(state.step, state.seconds, report, settings.batch, waited, state.skipped, len(known))
            if state.skipped_in_a_row >= TOLERATED_IN_A_ROW:
                raise broken_down(out, state.step, portion, None if fabric.world_size == 1 else fabric.global_rank)
            if feed.validation and (state.step % settings.validate_every == 0 or state.step == settings.steps):
                state.validation_due = True
            _check(state, feed.validation, out, log, session)
            if _any(fabric, session.over):
                break
            if leads and session.save_due:
                session.saved(lambda: save_checkpoint(folder, state))
        if leads and (state.step > first or (owed and not state.validation_due)):
            save_checkpoint(folder, state)
    return Outcome(state.step, state.step >= settings.steps and not state.validation_due, state.skipped)


def _check(state: TrainingState, validation: Sequence[Batch], out: Path, log: RunLog, session: Session) -> None:
    """If it is due, validate the averaged weights, log the result, and save them if they are the best so far.

    If the session is to stop, the validation remains due, and the next session begins with it.
    """
    if not state.validation_due:
        return
    try:
        result = state.supervision.validate(state.average.module, session.until_stopped(validation))
    except Stopped:
        return
    state.validation_due = False
    log.validation(state.step, result)
    if result.pictures is not None:
        (out / "validation").mkdir(exist_ok=True)
        write_png(out / "validation" / f"{state.step:08d}.png", result.pictures)
    if math.isfinite(result.score) and result.score > state.best_score:
        state.best_step, state.best_score = state.step, result.score
        save_checkpoint(out / "checkpoints", state)


def _any(fabric: Any, flag: bool) -> bool:
    """Whether the flag is set in any of the processes; all of them get the same answer."""
    return bool(fabric.all_reduce(torch.tensor(float(flag), device=fabric.device), reduce_op="sum") > 0)
