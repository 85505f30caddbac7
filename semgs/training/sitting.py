"""A sitting: the time that it may take, when a checkpoint is due, and how it is asked to end."""

from __future__ import annotations

import signal
import threading
import time
from collections.abc import Callable, Iterable, Iterator
from types import TracebackType
from typing import Any, TypeVar

Item = TypeVar("Item")


class Sitting:
    """One sitting of a run, as a context manager; inside it SIGTERM and Ctrl-C ask for its end, and a second Ctrl-C interrupts at once.

    Only the main thread of a process hears signals.

    Args:
        minutes: it may take; None is any number.
        save_minutes: between checkpoints.
        before: seconds that the run has taken in earlier sittings.
    """

    def __init__(self, minutes: float | None, save_minutes: float, before: float) -> None:
        self._began = self._saved = self._stepped = time.monotonic()
        self._minutes, self._save_minutes, self._before = minutes, save_minutes, before
        self._step = self._save = 0.0
        self._asked = threading.Event()
        self._handlers: dict[int, Any] = {}

    def __enter__(self) -> Sitting:
        def ask(number: int, frame: object) -> None:
            if self._asked.is_set() and number == signal.SIGINT:
                raise KeyboardInterrupt
            self._asked.set()

        if threading.current_thread() is threading.main_thread():
            self._handlers = {number: signal.signal(number, ask) for number in (signal.SIGTERM, signal.SIGINT)}
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        for number, handler in self._handlers.items():
            signal.signal(number, handler)

    def stepped(self) -> float:
        """Take note of the end of a step, and return the seconds that the run has taken."""
        now = time.monotonic()
        self._step, self._stepped = max(self._step, now - self._stepped), now
        return self._before + now - self._began

    def saved(self, save: Callable[[], object]) -> None:
        """Save, and take note of how long it took."""
        began = time.monotonic()
        save()
        self._saved = self._stepped = time.monotonic()
        self._save = max(self._save, self._saved - began)

    @property
    def over(self) -> bool:
        """Whether its end was asked for, or another step, a checkpoint and the weights would no longer fit.

        A step takes as long as the longest so far, and the last two as long as a checkpoint each.
        """
        if self._asked.is_set() or self._minutes is None:
            return self._asked.is_set()
        return time.monotonic() + self._step + 2 * self._save - self._began >= 60 * self._minutes

    @property
    def save_due(self) -> bool:
        """Whether a checkpoint is due."""
        return time.monotonic() - self._saved >= 60 * self._save_minutes


def timed(items: Iterable[Item]) -> Iterator[tuple[Item, float]]:
    """Each item with the seconds that were spent waiting for it."""
    iterator = iter(items)
    while True:
        asked = time.monotonic()
        try:
            item = next(iterator)
        except StopIteration:
            return
        yield item, time.monotonic() - asked
