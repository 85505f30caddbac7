"""Progress of long work on stderr: a spinner where there is a terminal, and one line per stage that is done."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from time import perf_counter

from rich.console import Console


@contextmanager
def show_stage(title: str) -> Iterator[None]:
    """Show that a stage is going on, then that it is done and how long it took."""
    console = Console(stderr=True, highlight=False)
    start = perf_counter()
    with console.status(title, spinner="dots"):
        yield
    console.print(f"{title}  [dim]{perf_counter() - start:.1f} s[/dim]", soft_wrap=True)
