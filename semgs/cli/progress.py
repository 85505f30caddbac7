"""Progress of long work: on a terminal's stderr a spinner, and a line for each stage that is done; elsewhere silence."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import contextmanager
from time import perf_counter

from rich.console import Console
from rich.progress import BarColumn, MofNCompleteColumn, Progress, TextColumn, TimeRemainingColumn


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
    with console.status(title, spinner="dots"):
        yield
    console.print(f"{title}  {perf_counter() - start:.1f} s", style="dim", soft_wrap=True)


@contextmanager
def show_progress(title: str, count: int) -> Iterator[Callable[[], None]]:
    """Show how many of `count` parts of a work are done and how long the rest will take.

    Yields:
        What is to be called after each part. Where stderr is no terminal, nothing is shown.
    """
    console = Console(stderr=True, highlight=False, markup=False)
    if not console.is_terminal:
        yield lambda: None
        return
    start = perf_counter()
    columns = (TextColumn(title), BarColumn(), MofNCompleteColumn(), TimeRemainingColumn())
    with Progress(*columns, console=console, transient=True) as progress:
        task = progress.add_task(title, total=count)
        yield lambda: progress.advance(task)
    console.print(f"{title}  {perf_counter() - start:.1f} s", style="dim", soft_wrap=True)
