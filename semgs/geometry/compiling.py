"""How long Numba compiles: the first time a kernel is needed on a machine; later it is read from disk."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import contextmanager
from time import perf_counter


@contextmanager
def watch_compiling(began: Callable[[], object]) -> Iterator[Callable[[], float]]:
    """Time what Numba compiles inside the block, in any thread.

    Args:
        began: called each time that it begins; never for kernels that come from disk.

    Yields:
        A function that says how long it has compiled so far [s].
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
