"""Tables of the bench: one result, or two compared."""

from __future__ import annotations

from collections.abc import Sequence

from paper.bench.bench_file import BenchReport
from semgs.evaluation.tables.table_grid import Cell, Format, Grid, printed


def bench_table(bench: BenchReport) -> str:
    """The table of one bench."""
    rows = []
    absent: dict[str, list[str]] = {}
    notes = ["seconds: the fastest repeat. MB: peak memory of the process, or of the GPU on CUDA."]
    for result in bench.results:
        if result.seconds is None:
            absent.setdefault(result.reason or "not measured", []).append(result.name)
            continue
        times = (_seconds(result.seconds), _seconds(result.seconds_median))
        rows.append(tuple(map(Cell, (result.name, *times, _megabytes(result.peak_memory_mb)))))
    for reason, names in absent.items():
        few = ", ".join(names) if len(names) <= 3 else f"{len(names)} rows, from {names[0]} to {names[-1]}"
        notes.append(f"Not measured ({reason}): {few}.")
    return printed(Grid("", ("row", "seconds", "median", "MB"), tuple(rows), notes=tuple(notes)), "text")


def comparison_table(first: BenchReport, second: BenchReport, names: Sequence[str], form: Format = "text") -> str:
    """The rows that both benches measured, with the ratio of their times.

    Raises:
        ValueError: there is no such row.
    """
    rows = []
    for name, before in first.by_name.items():
        after = second.by_name.get(name)
        if after is None or not before.seconds or after.seconds is None:
            continue
        ratio = f"{after.seconds / before.seconds:.3f}"
        memory = (_megabytes(before.peak_memory_mb), _megabytes(after.peak_memory_mb))
        rows.append(tuple(map(Cell, (name, _seconds(before.seconds), _seconds(after.seconds), ratio, *memory))))
    if not rows:
        raise ValueError(f"{names[0]} and {names[1]} have no measured row in common")
    head = ("row", f"{names[0]} [s]", f"{names[1]} [s]", "ratio", f"{names[0]} [MB]", f"{names[1]} [MB]")
    notes = ("ratio: seconds of the second file divided by those of the first.",)
    return printed(Grid("", head, tuple(rows), notes=notes), form)


def _seconds(value: float | None) -> str:
    """Seconds as text."""
    return "–" if value is None else f"{value:.4f}" if value < 1 else f"{value:.3f}"


def _megabytes(value: float | None) -> str:
    """10^6 bytes as text."""
    return "–" if value is None else f"{value:,.0f}"
