"""Time: stages of long work, each shown when it begins and timed, how long Numba compiles in them, and a clock that waits for CUDA."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import contextmanager
from time import perf_counter

from semgs.runtime.notes import Progress

COMPILE = "compile"
"""The stage for compiling kernels, in whichever stage it happens. It is absent if all kernels are cached on disk."""


class Stages:
    """A stopwatch for stages.

        stages = Stages()
        with stages("read", "Reading 3 frames"):
            ...
        stages.seconds["read"]

    Args:
        progress: shows each stage, and that kernels are compiled. By default nothing is shown.

    Attributes:
        seconds: wall-clock seconds of each finished stage, without those of `COMPILE`; repeated stages add up.
    """

    def __init__(self, progress: Progress | None = None) -> None:
        self._progress = progress or Progress()
        self.seconds: dict[str, float] = {}

    @contextmanager
    def __call__(self, name: str, title: str) -> Iterator[None]:
        """Time a stage: `name` is its key in `seconds`, `title` is shown."""
        with self._progress.stage(title), self._timing(name):
            yield

    @contextmanager
    def steps(self, name: str, title: str, count: int) -> Iterator[Callable[[int], None]]:
        """Time a stage of counted steps. Call the yielded function with the number of steps so far."""
        with self._progress.steps(title, count) as done, self._timing(name):
            yield done

    @contextmanager
    def _timing(self, name: str) -> Iterator[None]:
        """Add the time of the block to a stage."""
        with watch_compiling(self._compiling_began) as compiled:
            start = perf_counter()
            yield
            self.seconds[name] = self.seconds.get(name, 0.0) + perf_counter() - start - compiled()
            if compiled():
                self.seconds[COMPILE] += compiled()

    def _compiling_began(self) -> None:
        """Report it, the first time."""
        if COMPILE not in self.seconds:
            self.seconds[COMPILE] = 0.0
            self._progress.compiling()


def now() -> float:
    """The time, after all pending work on CUDA is finished [s]."""
    import torch  # takes seconds, and commands import this module before they check their options

    if torch.cuda.is_initialized():
        torch.cuda.synchronize()
    return perf_counter()


@contextmanager
def watch_compiling(began: Callable[[], object]) -> Iterator[Callable[[], float]]:
    """Time what Numba compiles inside the block, in any thread. It compiles a kernel when a machine first needs it, and later reads it from disk.

    Args:
        began: called whenever a compilation starts; never for kernels read from disk.

    Yields:
        A function that returns the time spent compiling so far [s].
    """
    from numba.core.event import Event, Listener, install_listener

    class Stopwatch(Listener):
        """Adds up the seconds of the outermost events: a kernel compiles the functions it calls inside its own event."""

        seconds, depth, start = 0.0, 0, 0.0

        def on_start(self, event: Event) -> None:
            if self.depth == 0:
                began()
                self.start = perf_counter()
            self.depth += 1

        def on_end(self, event: Event) -> None:
            self.depth -= 1
            if self.depth == 0:
                self.seconds += perf_counter() - self.start

    stopwatch = Stopwatch()
    with install_listener("numba:compile", stopwatch):
        yield lambda: stopwatch.seconds
