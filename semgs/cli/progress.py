"""Progress of long work, shown on stderr if it is a terminal: a spinner and a line for each stage, or a bar with the time left.

If the environment variable `SEMGS_PROGRESS` is "json", stderr gets a line of JSON for each stage instead: {"stage": title}, and for counted work also "done" and "of".
"""

from __future__ import annotations

import json
import os
import sys
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from time import perf_counter

from rich.console import Console
from rich.progress import BarColumn, MofNCompleteColumn, Progress, TextColumn, TimeRemainingColumn

from semgs.files.text import printable

VARIABLE = "SEMGS_PROGRESS"


def report_stage(title: str, **counts: int) -> bool:
    """Report a stage to a program that reads stderr. Returns whether one does."""
    if os.environ.get(VARIABLE) != "json":
        return False
    print(json.dumps({"stage": title, **counts}), file=sys.stderr, flush=True)
    return True


def announce(line: str) -> None:
    """Print a line about work that is about to start; a program that reads stderr gets it as a stage."""
    if not report_stage(line):
        print(line)


@contextmanager
def show_stage(title: str) -> Iterator[None]:
    """Show that a stage is running, then how long it took.

    If stderr is no terminal, nothing is shown: programs that read it expect errors only.
    """
    report_stage(title)
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
    if report_stage(title, done=0, of=total):

        def report(count: int, words: str = "") -> None:
            report_stage(title, done=count, of=total)

        yield report
        return
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
    if report_stage("Compiling, once on this machine"):
        return
    print("Compiling kernels, once: about 10 s", file=sys.stderr, flush=True)
