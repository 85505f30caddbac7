"""A session of a run: how long it may take, when a checkpoint is due, how to stop it, and faults that do not end it at once."""

from __future__ import annotations

import signal
import threading
import time
from collections.abc import Callable, Iterable, Iterator, Sequence
from pathlib import Path
from types import TracebackType
from typing import Any, TypeVar

from safetensors.torch import save
from torch import Tensor

from semgs.files.atomic import write_bytes
from semgs.training.data.batches import Portion
from semgs.training.data.data_check.open_sources import check_bad

Item = TypeVar("Item")


class Stopped(Exception):
    """A signal asked the session to stop."""


class Session:
    """One session of a run, as a context manager. Inside it SIGTERM or Ctrl-C stops after the current step or batch of a
    validation, a second Ctrl-C at once.

    Signals reach only the main thread of a process.

    Args:
        minutes: how long it may take; None sets no limit.
        save_minutes: time between checkpoints.
        before: seconds that the run took in earlier sessions.
    """

    def __init__(self, minutes: float | None = None, save_minutes: float = 5.0, before: float = 0.0) -> None:
        self._began = self._saved = self._stepped = time.monotonic()
        self._minutes, self._save_minutes, self._before = minutes, save_minutes, before
        self._step = self._save = 0.0
        self._stopping = threading.Event()
        self._handlers: dict[int, Any] = {}

    def __enter__(self) -> Session:
        def stop(number: int, frame: object) -> None:
            if self._stopping.is_set() and number == signal.SIGINT:
                raise KeyboardInterrupt
            self._stopping.set()

        if threading.current_thread() is threading.main_thread():
            self._handlers = {number: signal.signal(number, stop) for number in (signal.SIGTERM, signal.SIGINT)}
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        for number, handler in self._handlers.items():
            signal.signal(number, handler)

    def end_step(self) -> float:
        """Note the end of a step; the seconds that the run has taken."""
        now = time.monotonic()
        self._step, self._stepped = max(self._step, now - self._stepped), now
        return self._before + now - self._began

    def time_save(self, save: Callable[[], object]) -> None:
        """Save, and note how long it took."""
        began = time.monotonic()
        save()
        self._saved = self._stepped = time.monotonic()
        self._save = max(self._save, self._saved - began)

    @property
    def over(self) -> bool:
        """Whether to stop: on a signal, or if another step, a checkpoint and the weights would take too long.

        A step is assumed to take as long as the longest so far, the other two as long as a checkpoint each.
        """
        if self.stopping or self._minutes is None:
            return self.stopping
        return time.monotonic() + self._step + 2 * self._save - self._began >= 60 * self._minutes

    @property
    def stopping(self) -> bool:
        """Whether a signal asked to stop."""
        return self._stopping.is_set()

    def until_stopped(self, items: Iterable[Item]) -> Iterator[Item]:
        """The items, as long as no signal asks to stop.

        Raises:
            Stopped: instead of the next item.
        """
        for item in items:
            if self.stopping:
                raise Stopped
            yield item

    @property
    def save_due(self) -> bool:
        """Whether a checkpoint is due."""
        return time.monotonic() - self._saved >= 60 * self._save_minutes


def time_waiting(items: Iterable[Item]) -> Iterator[tuple[Item, float]]:
    """Each item with the seconds that were spent waiting for it."""
    iterator = iter(items)
    while True:
        began = time.monotonic()
        try:
            item = next(iterator)
        except StopIteration:
            return
        yield item, time.monotonic() - began


TOLERATED_IN_A_ROW = 10
"""A run ends after this many steps in a row without a finite gradient."""


class BadScenes:
    """Scenes that could not be read; each is reported once.

    Args:
        scenes: how many scenes there are in total.
        say: reports a sentence.
        known: bad scenes that were found before the first step.
    """

    def __init__(self, scenes: int, say: Callable[[str], None], known: Sequence[tuple[str, str]]) -> None:
        self._scenes, self._say = scenes, say
        self._known: dict[str, str] = {}
        self.add(known)

    def __len__(self) -> int:
        return len(self._known)

    def add(self, scenes: Sequence[tuple[str, str]]) -> None:
        """Add bad scenes: path and reason.

        Raises:
            InputError: there are too many now.
        """
        for path, why in scenes:
            if path not in self._known:
                self._known[path] = why
                self._say(f"bad scene, skipped: {why}")
        check_bad(list(self._known.items()), self._scenes)


def save_broken_batch(out: Path, step: int, portion: Portion, process: int | None = None) -> FloatingPointError:
    """Save the last batch of a run without finite gradients for inspection, each process its own. Returns the error that ends the run."""
    name = "bad_batch.safetensors" if process is None else f"bad_batch_{process}.safetensors"
    tensors: dict[str, Tensor] = {}
    for number, batch in enumerate(portion.pieces):
        for part, views in (("context", batch.context), ("target", batch.target)):
            values = {**vars(views), **vars(views.cameras)}
            tensors |= {
                f"{number}.{part}.{key}": value.contiguous()
                for key, value in values.items()
                if isinstance(value, Tensor)
            }
    scenes = ", ".join(scene for batch in portion.pieces for scene in batch.scenes)
    write_bytes(out / name, save(tensors, {"scenes": scenes}))
    return FloatingPointError(
        f"{out}: {TOLERATED_IN_A_ROW} steps in a row up to step {step} had no finite gradient; the last "
        f"batch is in {name}; a lower learning rate may help, from a new run folder"
    )
