"""Runs the bench: from rows to results."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from statistics import median
from typing import Any

import torch

from paper.bench.bench_file import BenchReport, BenchResult
from paper.bench.measure import REPEATS, WARM_UPS, WHOLE, CannotMeasureError, Seconds, measure
from paper.bench.peak_memory import MEGABYTE, peaks_of
from paper.bench.rows import BenchRow
from paper.bench.watches import Stopwatch
from paper.bench.workloads import Run, compile_kernels, prepare


def count_steps(rows: Sequence[BenchRow]) -> int:
    """How often `run_bench` calls `done` for these rows if all can be measured."""
    runs = {row.run for row in rows}
    return len(runs) * (WARM_UPS + REPEATS) + sum(run.device == "cpu" for run in runs)


def run_bench(
    rows: Sequence[BenchRow],
    machine: Mapping[str, Any],
    *,
    prepared: Callable[[BenchRow], Run] = prepare,
    begin: Callable[[], None] = compile_kernels,
    peaks: Callable[[str], dict[str, float] | None] = peaks_of,
    done: Callable[[], None] = lambda: None,
) -> BenchReport:
    """Measure rows, in rounds over all of them.

    Args:
        rows: to measure.
        machine: its description.
        prepared: makes the run of a row.
        begin: called before anything is measured on the CPU.
        peaks: returns the peak memory of a row by part.
        done: called after every run.
    """
    if any(row.device == "cpu" for row in rows):
        begin()
    names = {row.run: row.name for row in reversed(rows)}
    found = _timed(list(dict.fromkeys(row.run for row in rows)), prepared, done)
    for run, one in found.items():
        if run.device == "cpu" and one.reason is None:
            one.peaks = peaks(names[run]) or {}
            done()
    return BenchReport(dict(machine), tuple(found[row.run].result(row) for row in rows))


@dataclass
class _Measured:
    """The measurements of a run."""

    times: Sequence[Seconds] = ()
    peaks: Mapping[str, float] = field(default_factory=dict)
    reason: str | None = None

    def result(self, row: BenchRow) -> BenchResult:
        """The result of a row."""
        part = row.part if row.kind == "network" else WHOLE
        seconds = [times[part] for times in self.times if part in times]
        if not seconds:
            return BenchResult(row.name, None, reason=self.reason or f"{part} is not timed separately here")
        return BenchResult(row.name, min(seconds), median(seconds), len(seconds), self.peaks.get(part))


def _timed(
    runs: Sequence[BenchRow], prepared: Callable[[BenchRow], Run], done: Callable[[], None]
) -> dict[BenchRow, _Measured]:
    """The times of each run."""
    found: dict[BenchRow, _Measured] = {}
    going: dict[BenchRow, Callable[[], Seconds]] = {}
    for run in runs:
        try:
            going[run] = _watched(prepared(run), run.device)
        except CannotMeasureError as error:
            found[run] = _Measured(reason=str(error))
    for run, times in measure(going, done=lambda key: done()).items():
        if isinstance(times, CannotMeasureError):
            found[run] = _Measured(reason=str(times))
        else:
            found[run] = _Measured(times, {WHOLE: _peak_on_gpu(going[run])} if run.device == "cuda" else {})
    return {run: found[run] for run in runs}


def _watched(run: Run, device: str) -> Callable[[], Seconds]:
    """A run that returns the seconds of its parts."""

    def timed() -> Seconds:
        watch = Stopwatch(device)
        run(watch)
        return watch.seconds

    return timed


def _peak_on_gpu(run: Callable[[], Seconds]) -> float:
    """Peak GPU memory of one more run [10^6 bytes]."""
    torch.cuda.reset_peak_memory_stats()
    run()
    return torch.cuda.max_memory_allocated() / MEGABYTE
