"""Run: from rows to results."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from statistics import median
from typing import Any

import torch

from semgs.bench.measure import REPEATS, WARM_UPS, WHOLE, CannotMeasureError, Seconds, measure
from semgs.bench.memory import MEGABYTE, peaks_of
from semgs.bench.results import Bench, Result
from semgs.bench.rows import Row
from semgs.bench.watches import Stopwatch
from semgs.bench.workloads import Run, compile_kernels, prepare


def steps(rows: Sequence[Row]) -> int:
    """How many times `done` of `run_bench` will be called for these rows, if all can be measured."""
    runs = {row.run for row in rows}
    return len(runs) * (WARM_UPS + REPEATS) + sum(run.device == "cpu" for run in runs)


def run_bench(
    rows: Sequence[Row],
    machine: Mapping[str, Any],
    *,
    prepared: Callable[[Row], Run] = prepare,
    begin: Callable[[], None] = compile_kernels,
    peaks: Callable[[str], dict[str, float] | None] = peaks_of,
    done: Callable[[], None] = lambda: None,
) -> Bench:
    """Measure rows, in turns, so that what slows the machine down for a while slows all of them down.

    Args:
        rows: to measure.
        machine: what is known of it.
        prepared: makes what a row runs.
        begin: called before anything is measured on the CPU.
        peaks: gives the peak memory of a row by part.
        done: told of every run that is done.
    """
    if any(row.device == "cpu" for row in rows):
        begin()
    names = {row.run: row.name for row in reversed(rows)}
    found = _timed(list(dict.fromkeys(row.run for row in rows)), prepared, done)
    for run, one in found.items():
        if run.device == "cpu" and one.reason is None:
            one.peaks = peaks(names[run]) or {}
            done()
    return Bench(dict(machine), tuple(found[row.run].result(row) for row in rows))


@dataclass
class _Measured:
    """What was found of a run."""

    times: Sequence[Seconds] = ()
    peaks: Mapping[str, float] = field(default_factory=dict)
    reason: str | None = None

    def result(self, row: Row) -> Result:
        """What a row says of it."""
        part = row.part if row.kind == "network" else WHOLE
        seconds = [times[part] for times in self.times if part in times]
        if not seconds:
            return Result(row.name, None, reason=self.reason or f"{part} is not told apart here")
        return Result(row.name, min(seconds), median(seconds), len(seconds), self.peaks.get(part))


def _timed(runs: Sequence[Row], prepared: Callable[[Row], Run], done: Callable[[], None]) -> dict[Row, _Measured]:
    """Each of the runs measured, in turn."""
    found: dict[Row, _Measured] = {}
    going: dict[Row, Callable[[], Seconds]] = {}
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
    """A run that says how long its parts took."""

    def timed() -> Seconds:
        watch = Stopwatch(device)
        run(watch)
        return watch.seconds

    return timed


def _peak_on_gpu(run: Callable[[], Seconds]) -> float:
    """The most memory of the GPU that one more run needs [10^6 bytes]."""
    torch.cuda.reset_peak_memory_stats()
    run()
    return torch.cuda.max_memory_allocated() / MEGABYTE
