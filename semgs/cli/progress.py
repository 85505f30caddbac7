"""Progress of long work: on a terminal's stderr a spinner, and a line for each stage that is done; elsewhere silence."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from time import perf_counter

from rich.console import Console


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
