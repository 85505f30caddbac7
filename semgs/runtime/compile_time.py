"""Measure how long Numba compiles. It compiles a kernel when a machine first needs it, and later reads it from disk."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import contextmanager
from time import perf_counter


@contextmanager
def watch_compiling(began: Callable[[], object]) -> Iterator[Callable[[], float]]:
    """Time what Numba compiles inside the block, in any thread.

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
