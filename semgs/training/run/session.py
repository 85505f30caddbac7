"""A session of a run: how long it may take, when a checkpoint is due, and how to stop it."""

from __future__ import annotations

import signal
import threading
import time
from collections.abc import Callable, Iterable, Iterator
from types import TracebackType
from typing import Any, TypeVar

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
