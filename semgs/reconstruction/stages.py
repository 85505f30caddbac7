"""Stages: the parts of long work, announced as they begin and timed."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import AbstractContextManager, contextmanager, nullcontext
from time import perf_counter


class Stages:
    """A stopwatch for the parts of a work.

        stages = Stages()
        with stages("read", "Reading 3 frames"):
            ...
        stages.seconds["read"]

    Args:
        show: what stands around each stage, given its title: a spinner, say. Nothing is shown by default.

    Attributes:
        seconds: wall-clock seconds of each stage that is done; a stage that comes twice adds up.
    """

    def __init__(self, show: Callable[[str], AbstractContextManager[object]] = nullcontext) -> None:
        self._show = show
        self.seconds: dict[str, float] = {}

    @contextmanager
    def __call__(self, name: str, title: str) -> Iterator[None]:
        """Run a stage: its name in `seconds`, its title for the reader."""
        with self._show(title):
            start = perf_counter()
            yield
            self.seconds[name] = self.seconds.get(name, 0.0) + perf_counter() - start
