"""The training loop.

    RUN/settings.json          the settings of the training
    RUN/network.json           the settings of the network
    RUN/init.json              the SHA-256 of the initial weights, if they are a file; backbone.json: likewise
    RUN/data.json              the scenes, their class counts and terms
    RUN/log.jsonl              losses, speed and validations, one JSON object per line
    RUN/tensorboard/*          the same for TensorBoard
    RUN/validation/*.png       strips of images: image, truth, classes, truth, depth, truth
    RUN/checkpoints/*          the last three checkpoints and the best
    RUN/rooms/*                rooms that several samples share, if the settings ask for that
    RUN/weights.safetensors    the averaged weights, written at the end of each session; best.safetensors: those of the best validation

The same call starts and resumes a run; one without a checkpoint starts again, with whatever settings. With more `steps` the run becomes longer, and from then on its learning rate is that of the
longer run. Step k sees batch k, which depends on the seed and k alone: on a CPU a resumed run gives exactly the same result as an
uninterrupted one. On CUDA gradients are summed in no fixed order. Several processes share the scenes of each step; only the first one
writes checkpoints, the log and weights.
"""

from __future__ import annotations

import math
import time
from collections.abc import Iterable, Sequence
from contextlib import nullcontext
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import torch
from rich.console import Console

from semgs.data.views import Batch
from semgs.files.atomic import remove_parts
from semgs.files.errors import check_type, input_error
from semgs.files.images.pictures import write_png
from semgs.files.paths import typed_path
from semgs.training.data.batches import Portion, training_batches, validation_batches
from semgs.training.data.data_check.data_check import check_data
from semgs.training.data.room_source import room_source
from semgs.training.data.teacher import Teacher
from semgs.training.presets import preset_changes
from semgs.training.run.checkpoints import Checkpoint, newest_checkpoint, save_checkpoint
from semgs.training.run.execution import Execution, launch
from semgs.training.run.log import RunLog, print_lines
from semgs.training.run.run_folder import (
    ROOMS_POOL,
    SETTINGS,
    WEIGHTS,
    claim_folder,
    empty_network,
    export_weights,
    has_begun,
    lock_run,
    record_files,
    start_network,
    start_run,
)
from semgs.training.run.session import TOLERATED_IN_A_ROW, BadScenes, Session, Stopped, save_broken_batch, time_waiting
from semgs.training.schedule import Schedule, relative_rates, what_learns
from semgs.training.state import TrainingState, training_step
from semgs.training.supervision.supervision import make_supervision
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
        settings: what to compute; a folder with a run of other settings is refused once it has a checkpoint, but one of fewer steps becomes longer.
        out: the run folder.
        execution: how to run it; None is the default. A run may resume on another device, but not to the same bits.
        console: where the first process shows progress; None shows nothing.

    Raises:
        ValueError: a required setting is missing, or a step cannot be shared equally.
        InputError: the folder is a run with other settings, or contains something else or only damaged checkpoints, another process trains into it, the data, assets or
            initial weights cannot be used, or its checkpoints are of another network.
        ImportError: training or its rooms need an extra that is not installed.
        FloatingPointError: ten steps in a row had no finite gradient; the last batch is saved in the run folder.
    """
    began = time.monotonic()
    check_type("settings are", settings, TrainingSettings, "TrainingSettings, such as those of a preset")
    out = typed_path(out)
    execution = execution or Execution()
    settings.check_complete()
    execution.share().check(settings.batch)
    if settings.needs_rooms:
        rooms = room_source()  # which may not be installed
        for folder in settings.assets:
            rooms.verify(Path(folder))
    claim_folder(out, settings)
    if has_begun(out):
        record_files(out, settings)  # while there are no other processes, which would wait for the first one
    fabric = launch(execution)
    leads = fabric.is_global_zero
    console = console if leads else None
    print_lines(console, preset_changes(settings))
    with lock_run(out) if leads else nullcontext():
        if leads:
            start_run(out, settings)
            if fabric.world_size == 1:  # other processes of a training write without the lock
                for part in (out, out / "checkpoints", out / "validation"):
                    remove_parts(part, out / SETTINGS)
        fabric.barrier()  # the others read what the first one has recorded
        state, feed = _prepare(settings, out, execution, fabric, console)
        left = None if execution.minutes is None else execution.minutes - (time.monotonic() - began) / 60
        session = Session(left, execution.save_minutes, state.seconds)
        outcome = fit(
            state, settings, out, feed, session,
            validate_every=settings.validate_every, validate_start=settings.init != "random", console=console,
        )  # fmt: skip
        has_checkpoint = outcome.step > 0
        if leads and has_checkpoint:
            export_weights(out)
        weights = f"; weights: {out / WEIGHTS}" if has_checkpoint else ""
        summary = f"step {outcome.step} of {settings.steps}, {outcome.skipped} skipped{weights}"
        print_lines(console, [summary, *([] if outcome.finished else ["repeat the command to resume"])])
        return outcome


def _prepare(
    settings: TrainingSettings, out: Path, execution: Execution, fabric: Any, console: Console | None
) -> tuple[TrainingState, Feed]:
    """The network with its optimiser, resumed from the newest checkpoint, and the batches from there on."""
    checkpoint = newest_checkpoint(out / "checkpoints")
    network = start_network(out, settings) if checkpoint is None else empty_network(out, settings)
    data = check_data(settings, settings, settings.init, out)
    device = execution.device if fabric.world_size == 1 else f"{execution.device}, {fabric.world_size} processes"
    print_lines(console, [*data.notes, f"{settings.model}: {network.origin}", f"on {device}"])
    teacher = Teacher.open(settings.teacher) if settings.teacher else None
    state = TrainingState.begin(
        network.to(fabric.device),
        make_supervision(settings, data.class_weights, 0 if teacher is None else teacher.classes),
        settings.learning_rate,
        settings.average_decay,
        fabric,
        rates=relative_rates(network, settings),
    )
    print_lines(console, [what_learns(network)])
    resume(state, out, checkpoint, console)
    batches = training_batches(
        settings, data, settings.steps, state.step, pool=out / ROOMS_POOL, workers=execution.workers,
        cache=round(execution.cache_gib * 2**30), share=execution.share(fabric.global_rank),
        single_images=settings.single_images, teacher=teacher,
    )  # fmt: skip
    validation = validation_batches(settings, data.classes, settings.single_images) if fabric.is_global_zero else []
    return state, Feed(batches, validation, data.scenes, data.bad)


def resume(state: TrainingState, out: Path, checkpoint: Checkpoint | None, console: Console | None = None) -> None:
    """Restore the state from the run's newest intact checkpoint as the first process has read it, if there is one.

    Raises:
        InputError: the checkpoint is of another network.
    """
    checkpoint = state.fabric.broadcast(checkpoint if state.fabric.is_global_zero else None)
    if checkpoint is None:
        return
    advice = "another version of semgs wrote it; resume with that version, or name a new folder"
    with input_error(out / "checkpoints", "checkpoints of this network", advice=advice):
        state.restore(checkpoint.tensors, checkpoint.numbers)
    damaged = [f"{record}: damaged, skipped" for record in checkpoint.damaged]
    print_lines(console, [*damaged, f"resuming from step {state.step}"])


def fit(
    state: TrainingState,
    schedule: Schedule,
    out: Path,
    feed: Feed,
    session: Session,
    *,
    validate_every: int = 1000,
    validate_start: bool = False,
    console: Console | None = None,
) -> Outcome:
    """The loop itself: train from the state's own step to the last one, or until the session is over.

    Args:
        state: of the training; changed in place.
        schedule: of its steps.
        out: the run folder, for the log and checkpoints.
        feed: its batches.
        session: how long it may take.
        validate_every: steps between validations; there is one after the last step, too.
        validate_start: also validate before the first step, to see how good the initial weights are.
        console: where progress is shown; None shows nothing.

    Raises:
        InputError: too many scenes are bad.
        FloatingPointError: ten steps in a row had no finite gradient.
    """
    fabric, folder, first_step = state.fabric, out / "checkpoints", state.step
    leads, was_due = fabric.is_global_zero, state.validation_due
    with RunLog(out if leads else None, state.step, schedule.steps, console) as log, session:
        bad_scenes = BadScenes(feed.scenes, log.say, feed.bad)
        if feed.validation and validate_start and state.step == 0:
            state.validation_due = True
        _validate_if_due(state, feed.validation, out, log, session)
        batches = () if _any_process(fabric, session.stopping) else time_waiting(feed.batches)
        for portion, waited in batches:
            if portion.failure is not None:
                raise portion.failure
            bad_scenes.add(portion.bad)
            report = training_step(state, portion.pieces, schedule)
            state.seconds = session.end_step()
            scenes = fabric.world_size * sum(len(batch.scenes) for batch in portion.pieces)
            log.step(state.step, state.seconds, report, scenes, waited, state.skipped, len(bad_scenes))
            if state.skipped_in_a_row >= TOLERATED_IN_A_ROW:
                raise save_broken_batch(
                    out, state.step, portion, None if fabric.world_size == 1 else fabric.global_rank
                )
            if feed.validation and (state.step % validate_every == 0 or state.step == schedule.steps):
                state.validation_due = True
            _validate_if_due(state, feed.validation, out, log, session)
            if _any_process(fabric, session.over):
                break
            if leads and session.save_due:
                session.time_save(lambda: save_checkpoint(folder, state))
        if leads and (state.step > first_step or (was_due and not state.validation_due)):
            save_checkpoint(folder, state)
    return Outcome(state.step, state.step >= schedule.steps and not state.validation_due, state.skipped)


def _validate_if_due(state: TrainingState, batches: Sequence[Batch], out: Path, log: RunLog, session: Session) -> None:
    """If it is due, validate the averaged weights, log the result, and save them if they are the best so far.

    If the session is to stop, the validation remains due, and the next session begins with it.
    """
    if not state.validation_due:
        return
    try:
        result = state.supervision.validate(state.average.module, session.until_stopped(batches))
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


def _any_process(fabric: Any, flag: bool) -> bool:
    """Whether the flag is set in any of the processes; all of them get the same answer."""
    return bool(fabric.all_reduce(torch.tensor(float(flag), device=fabric.device), reduce_op="sum") > 0)
