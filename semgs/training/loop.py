"""The training loop.

    RUN/settings.json          what is computed
    RUN/log.jsonl              losses, speed and validations, a JSON object a line
    RUN/validation/*.png       strips of pictures: image, truth, classes, truth, depth, truth
    RUN/checkpoints/*          the last three whole states
    RUN/rooms/*                scenes that serve several samples, where the settings say so

A run is started, resumed and extended in time by the same call. Step k sees batch k of its seed, and batches are pure
functions of (seed, k): on the CPU of one machine an interrupted run gives the same bits as one that never was. On CUDA
gradients are summed in no fixed order.
"""

from __future__ import annotations

import signal
import threading
import time
from collections.abc import Iterable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path

from rich.console import Console
from safetensors.torch import save
from torch import Tensor

from semgs.data.views import Batch
from semgs.files.atomic import write_bytes
from semgs.files.errors import InputError
from semgs.files.pictures import write_png
from semgs.rooms.assets.lock import verify
from semgs.training.batches import training_batches, validation_batches
from semgs.training.checkpoints import newest_checkpoint, save_checkpoint
from semgs.training.log import RunLog
from semgs.training.run import claim, hold_assets
from semgs.training.settings import TrainingSettings
from semgs.training.state import TrainingState
from semgs.training.step import training_step
from semgs.training.validation import validate
from semgs.weights.load import load

TOLERATED_IN_A_ROW = 10
"""Steps without a finite gradient, one after the other, that end a run."""


@dataclass(frozen=True)
class Outcome:
    """How a sitting ended.

    Attributes:
        step: steps taken, over all sittings.
        finished: whether those are all; if not, the same call goes on from here.
        skipped: steps without a finite gradient.
    """

    step: int
    finished: bool
    skipped: int


def train(
    settings: TrainingSettings,
    out: Path,
    *,
    device: str = "cpu",
    minutes: float | None = None,
    workers: int = 1,
    save_minutes: float = 5.0,
    console: Console | None = None,
) -> Outcome:
    """Train, or go on training, into a run folder.

    Args:
        settings: what to compute; a folder that holds a run of others is refused.
        out: the run folder.
        device: where to compute, "cpu" or "cuda"; a run may go on on another, but not to the same bits.
        minutes: end after this time, cleanly; None is at the last step.
        workers: processes that prepare batches; 0 prepares them in this one.
        save_minutes: time between checkpoints.
        console: where progress is shown; None shows nothing.

    Raises:
        ValueError: the folder holds a run of other settings.
        InputError: it holds something else, the assets are missing or altered, or the state of another network, or the weights to start from do not fit.
        FloatingPointError: ten steps in a row had no finite gradient; their last batch is kept in the run folder.
    """
    for folder in settings.assets:
        verify(folder)
    claim(out, settings)
    hold_assets(out, settings.assets)
    model = load(settings.model, settings.weights, seed=settings.seed).to(device)
    state = TrainingState.begin(model, settings.learning_rate, settings.average_decay)
    resume(state, out, console)
    batches = training_batches(settings, state.step, workers, out / "rooms")
    return fit(
        state, settings, out, batches, validation_batches(settings),
        minutes=minutes, save_minutes=save_minutes, console=console,
    )  # fmt: skip


def resume(state: TrainingState, out: Path, console: Console | None = None) -> None:
    """Take the state to where the run's newest intact checkpoint left it, if there is one.

    Raises:
        InputError: it is the state of another network.
    """
    checkpoint = newest_checkpoint(out / "checkpoints")
    if checkpoint is None:
        return
    try:
        state.restore(checkpoint.tensors, checkpoint.numbers)
    except ValueError as error:
        advice = "another version of semgs wrote it; go on with that one or name a new folder"
        raise InputError(out / "checkpoints", "states of this network", str(error), advice=advice) from error
    if console is not None:
        for record in checkpoint.damaged:
            console.print(f"{record}: damaged, passed over", markup=False, highlight=False)
        console.print(f"going on from step {state.step}", markup=False, highlight=False)


def fit(
    state: TrainingState,
    settings: TrainingSettings,
    out: Path,
    batches: Iterable[Batch],
    validation: Sequence[Batch],
    *,
    minutes: float | None = None,
    save_minutes: float = 5.0,
    console: Console | None = None,
) -> Outcome:
    """The loop itself: take the state through the batches, which begin with that of its step."""
    began = saved = time.monotonic()
    seconds_before = state.seconds
    first = checked = state.step
    with RunLog(out / "log.jsonl", state.step, settings.steps, console) as log, _termination_asked() as asked:

        def check() -> None:
            result = validate(state.average.module, validation)
            log.validation(state.step, result)
            if result.pictures is not None:
                (out / "validation").mkdir(exist_ok=True)
                write_png(out / "validation" / f"{state.step:08d}.png", result.pictures)

        for batch, waited in _timed(batches):
            report = training_step(state, batch, settings)
            now = time.monotonic()
            state.seconds = seconds_before + now - began
            log.step(state.step, state.seconds, report, len(batch.scenes), waited, state.skipped)
            if state.skipped_in_a_row >= TOLERATED_IN_A_ROW:
                _keep(batch, out / "bad_batch.safetensors")
                raise FloatingPointError(
                    f"{out}: {TOLERATED_IN_A_ROW} steps in a row up to step {state.step} had no finite gradient; the last "
                    f"batch is in bad_batch.safetensors; a lower learning rate may help, from a new run folder"
                )
            if validation and state.step % settings.validate_every == 0:
                check()
                checked = state.step
            if asked.is_set() or (minutes is not None and now - began >= 60 * minutes):
                break
            if now - saved >= 60 * save_minutes:
                save_checkpoint(out / "checkpoints", state)
                saved = now
        finished = state.step >= settings.steps
        if finished and validation and checked < state.step:
            check()
        if state.step > first:
            save_checkpoint(out / "checkpoints", state)
    return Outcome(state.step, finished, state.skipped)


def _timed(batches: Iterable[Batch]) -> Iterator[tuple[Batch, float]]:
    """Each batch with the seconds that were spent waiting for it."""
    iterator = iter(batches)
    while True:
        asked = time.monotonic()
        try:
            batch = next(iterator)
        except StopIteration:
            return
        yield batch, time.monotonic() - asked


@contextmanager
def _termination_asked() -> Iterator[threading.Event]:
    """An event that SIGTERM and Ctrl-C set; a second Ctrl-C interrupts at once. Only the main thread hears signals."""
    asked = threading.Event()
    if threading.current_thread() is not threading.main_thread():
        yield asked
        return

    def ask(number: int, frame: object) -> None:
        if asked.is_set() and number == signal.SIGINT:
            raise KeyboardInterrupt
        asked.set()

    before = {number: signal.signal(number, ask) for number in (signal.SIGTERM, signal.SIGINT)}
    try:
        yield asked
    finally:
        for number, handler in before.items():
            signal.signal(number, handler)


def _keep(batch: Batch, path: Path) -> None:
    """Write a batch to look at."""
    tensors: dict[str, Tensor] = {}
    for name, views in (("context", batch.context), ("target", batch.target)):
        held = {
            "images": views.images,
            "labels": views.labels,
            "depths": views.depths,
            "depth_range": views.depth_range,
            "world_from_camera": views.cameras.world_from_camera,
            "intrinsics": views.cameras.intrinsics,
        }
        tensors |= {f"{name}.{key}": value.contiguous() for key, value in held.items() if value is not None}
    write_bytes(path, save(tensors, {"scenes": ", ".join(batch.scenes)}))
