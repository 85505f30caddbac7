"""Progress that is kept, to look at what was shown."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import contextmanager

from semgs.runtime.notes import Progress


class RecordedProgress(Progress):
    """Keeps what is reported.

    Attributes:
        titles: of stages and announced lines.
        counts: how many steps each counted stage has.
        done: what was reported of steps, of all stages.
        compilations: how often kernels were said to be compiled.
    """

    def __init__(self) -> None:
        self.titles: list[str] = []
        self.counts: list[int] = []
        self.done: list[int] = []
        self.compilations = 0

    @contextmanager
    def stage(self, title: str) -> Iterator[None]:
        self.titles.append(title)
        yield

    @contextmanager
    def steps(self, title: str, count: int) -> Iterator[Callable[[int], None]]:
        self.titles.append(title)
        self.counts.append(count)
        yield self.done.append

    def announce(self, line: str) -> None:
        self.titles.append(line)

    def compiling(self) -> None:
        self.compilations += 1
