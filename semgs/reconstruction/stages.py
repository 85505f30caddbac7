"""Stages: the parts of long work, announced as they begin and timed."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import AbstractContextManager, contextmanager, nullcontext
from time import perf_counter

from semgs.geometry.compiling import watch_compiling

COMPILE = "compile"
"""The stage that compiling kernels counts as, wherever it happens. A run that finds them all on disk has no such stage."""


class Stages:
    """A stopwatch for the parts of a work.

        stages = Stages()
        with stages("read", "Reading 3 frames"):
            ...
        stages.seconds["read"]

    Args:
        show: what stands around each stage, given its title: a spinner, say. Nothing is shown by default.
        compiling: called once, when kernels begin to be compiled.

    Attributes:
        seconds: wall-clock seconds of each stage that is done, without those of `COMPILE`; a stage that comes twice adds up.
    """

    def __init__(
        self,
        show: Callable[[str], AbstractContextManager[object]] = nullcontext,
        compiling: Callable[[], object] = lambda: None,
    ) -> None:
        self._show = show
        self._compiling = compiling
        self.seconds: dict[str, float] = {}

    @contextmanager
    def __call__(self, name: str, title: str) -> Iterator[None]:
        """Run a stage: its name in `seconds`, its title for the reader."""
        with self._show(title), watch_compiling(self._compiling_began) as compiled:
            start = perf_counter()
            yield
            self.seconds[name] = self.seconds.get(name, 0.0) + perf_counter() - start - compiled()
            if compiled():
                self.seconds[COMPILE] += compiled()

    def _compiling_began(self) -> None:
        """Say so, the first time."""
        if COMPILE not in self.seconds:
            self.seconds[COMPILE] = 0.0
            self._compiling()
