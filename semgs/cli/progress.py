"""Progress of long work, shown on stderr if it is a terminal: a spinner and a line for each stage, or a bar with the time left."""

from __future__ import annotations

import sys
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from time import perf_counter

from rich.console import Console
from rich.progress import BarColumn, MofNCompleteColumn, Progress, TextColumn, TimeRemainingColumn

from semgs.files.text import printable
from semgs.runtime import notes


@contextmanager
def show_stage(title: str) -> Iterator[None]:
    """Show that a stage is running, then how long it took.

    If stderr is no terminal, nothing is shown: programs that read it expect errors only.
    """
    console = Console(stderr=True, highlight=False, markup=False)
    if not console.is_terminal:
        yield
        return
    start = perf_counter()
    title = printable(title)
    with console.status(title, spinner="dots"):
        yield
    console.print(f"{title}  {perf_counter() - start:.1f} s", style="dim", soft_wrap=True)


@contextmanager
def show_progress(title: str, total: int) -> Iterator[Callable[..., None]]:
    """Show how much of some work is done, and the time left. Call the yielded function with the number of finished items, and a few words to show if
    there are any.

    If stderr is no terminal, nothing is shown.
    """
    console = Console(stderr=True, highlight=False, markup=False)
    if not console.is_terminal:
        yield lambda count, words="": None
        return
    start = perf_counter()
    title = printable(title)
    columns = (
        TextColumn(title),
        BarColumn(),
        MofNCompleteColumn(),
        TextColumn("time left"),
        TimeRemainingColumn(),
        TextColumn("{task.fields[words]}"),
    )
    with Progress(*columns, console=console, transient=True) as progress:
        task = progress.add_task(title, total=total, words="")
        begun = False

        def done(count: int, words: str = "") -> None:
            nonlocal begun
            if not begun:  # items from an earlier run say nothing about speed
                begun = True
                progress.reset(task, completed=count)
            progress.update(task, completed=count, words=words)

        yield done
    console.print(f"{title}  {perf_counter() - start:.1f} s", style="dim", soft_wrap=True)


def say_compiling() -> None:
    """Say on stderr, terminal or not, why the first run on a machine takes longer."""
    print("Compiling kernels, once: about 10 s", file=sys.stderr, flush=True)


class Terminal(notes.Progress):
    """Progress as a command shows it."""

    stage = staticmethod(show_stage)  # type: ignore[assignment]
    steps = staticmethod(show_progress)  # type: ignore[assignment]

    def announce(self, line: str) -> None:
        """Print a line about work that is about to start."""
        print(line)

    def compiling(self) -> None:
        """Say why the first run on a machine takes longer."""
        say_compiling()
