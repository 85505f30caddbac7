"""Progress of long work on a terminal's stderr, elsewhere silence: a spinner and a line for each stage, or a bar with the time left."""

from __future__ import annotations

import sys
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from time import perf_counter

from rich.console import Console
from rich.progress import BarColumn, MofNCompleteColumn, Progress, TextColumn, TimeRemainingColumn

from semgs.files.text import printable


@contextmanager
def show_stage(title: str) -> Iterator[None]:
    """Show that a stage is going on, then that it is done and how long it took.

    Where stderr is no terminal it is kept for what went wrong, so that programs can read it; the times are in the summary.
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
def show_progress(title: str, total: int) -> Iterator[Callable[[int], None]]:
    """Show how much of a long work is done and how long the rest will take; the yielded function is told how much is done.

    Where stderr is no terminal it is kept for what went wrong.
    """
    console = Console(stderr=True, highlight=False, markup=False)
    if not console.is_terminal:
        yield lambda count: None
        return
    start = perf_counter()
    title = printable(title)
    columns = (TextColumn(title), BarColumn(), MofNCompleteColumn(), TextColumn("time left"), TimeRemainingColumn())
    with Progress(*columns, console=console, transient=True) as progress:
        task = progress.add_task(title, total=total)
        begun = False

        def done(count: int) -> None:
            nonlocal begun
            if not begun:  # what an earlier run left says nothing about speed
                begun = True
                progress.reset(task, completed=count)
            progress.update(task, completed=count)

        yield done
    console.print(f"{title}  {perf_counter() - start:.1f} s", style="dim", soft_wrap=True)


def say_compiling() -> None:
    """Say why the first run on a machine takes longer, on stderr, terminal or not: nobody should wait without knowing why."""
    print("Compiling kernels, once: about 10 s", file=sys.stderr, flush=True)
