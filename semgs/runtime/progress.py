"""What long work tells whoever waits for it."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import contextmanager


class Progress:
    """Shows what is being done. This one shows nothing; the command line and the app have their own.

    Titles and lines may be a `semgs.files.notes.Note`, so that each can use its own words.
    """

    @contextmanager
    def stage(self, title: str) -> Iterator[None]:
        """Show a stage as long as the block runs."""
        yield

    @contextmanager
    def steps(self, title: str, count: int) -> Iterator[Callable[[int], None]]:
        """Show a stage of counted steps. Call the yielded function with the number of steps so far."""
        yield lambda steps: None

    def announce(self, line: str) -> None:
        """Say what is about to start."""

    def compiling(self) -> None:
        """Say that kernels are compiled, once on this machine."""
