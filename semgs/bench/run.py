"""Run: from rows to results."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from statistics import median
from typing import Any

import torch

from semgs.bench.flops import counted
from semgs.bench.measure import REPEATS, WARM_UPS, WHOLE, CannotMeasureError, Seconds, measure
from semgs.bench.memory import MEGABYTE, peaks_of
from semgs.bench.results import Bench, Result
from semgs.bench.rows import OPERATIONS, Row, ceiling, ceiling_row
from semgs.bench.targets import NO_BFLOAT16, has_bfloat16
from semgs.bench.watches import Stopwatch
from semgs.bench.workloads import Workload, compile_kernels, prepare

GIGA = 1e9

COUNTED = ("ceiling", "network", "train")
"""Kinds of rows whose operations torch does, and can count."""

IN_A_PROCESS_OF_ITS_OWN = ("network", "render", "train", "command")
"""Kinds of rows whose peak memory is measured."""


def steps(rows: Sequence[Row]) -> int:
    """How many times `done` of `run_bench` will be called for these rows, if all can be measured."""
    ceilings = _ceilings_for(rows)
    runs = {row.run for row in [*ceilings, *rows]}
    looked_at = len(_looked_at(ceilings)) * (WARM_UPS + 1)
    return looked_at + len(runs) * (WARM_UPS + REPEATS) + len([run for run in runs if _has_child(run)])


def run_bench(
    rows: Sequence[Row],
    machine: Mapping[str, Any],
    *,
    prepared: Callable[[Row], Workload] = prepare,
    begin: Callable[[], None] = compile_kernels,
    peaks: Callable[[str], dict[str, float] | None] = peaks_of,
    done: Callable[[], None] = lambda: None,
) -> Bench:
    """Measure rows, and the ceilings that they are compared with.

    Args:
        rows: to measure, in turns with the ceilings, so that what slows the machine down for a while slows down both.
        machine: what is known of it; the ceilings are added.
        prepared: makes what a row runs.
        begin: called before anything is measured on the CPU.
        peaks: gives the peak memory of a row by part.
        done: told of every run that is done.
    """
    if any(row.device == "cpu" for row in rows):
        begin()
    ceilings = _ceilings_for(rows)
    looked_at = _looked_at(ceilings)
    first = _speeds(looked_at, _measured([row.run for row in looked_at], prepared, done, repeats=1))
    runs: dict[Row, list[Row]] = {row.run: [] for row in ceilings}
    for row in rows:
        runs.setdefault(row.run, []).append(row)
    found = {run: _Measured(reason=NO_BFLOAT16) for run in runs if _without_hardware(run, first)}
    found |= _measured([run for run in runs if run not in found], prepared, done)
    known = _speeds(ceilings, found)
    for run, members in runs.items():
        if _has_child(run) and found[run].reason is None:
            found[run].peaks = peaks(members[0].name) or {}
            done()
    results = tuple(found[row.run].result(row, known) for row in rows)
    return Bench({**machine, "ceilings": {name: float(f"{speed:.6g}") for name, speed in known.items()}}, results)


@dataclass
class _Measured:
    """What was found of a run."""

    times: Sequence[Seconds] = ()
    operations: Mapping[str, Mapping[str, float]] = field(default_factory=dict)
    peaks: Mapping[str, float] = field(default_factory=dict)
    details: Mapping[str, float] = field(default_factory=dict)
    reason: str | None = None

    def seconds(self, part: str) -> list[float]:
        """Of each repeat."""
        return [times[part] for times in self.times if part in times]

    def speed(self, part: str) -> float | None:
        """GFLOP/s of the fastest repeat."""
        seconds, operations = self.seconds(part), self.operations.get(part)
        return sum(operations.values()) / min(seconds) / GIGA if seconds and operations else None

    def result(self, row: Row, ceilings: Mapping[str, float]) -> Result:
        """What a row says of it."""
        part = row.part if row.kind == "network" else WHOLE
        seconds = self.seconds(part)
        if not seconds:
            return Result(row.name, None, reason=self.reason or f"{part} is not told apart here")
        # Drawing is arithmetic of our own kernels, which nobody counts.
        counts = row.kind in COUNTED and part != "render"
        least, operations = min(seconds), self.operations.get(part, {}) if counts else {}
        total = sum(operations.values())
        ideal = _ideal_seconds(operations, row, ceilings)
        details = dict(self.details)
        if row.kind == "network" and row.part == WHOLE:
            details["frames_per_second"] = row.batch / least
        return Result(
            name=row.name,
            seconds=least,
            seconds_median=median(seconds),
            repeats=len(seconds),
            gflop=total / GIGA if total else None,
            gflop_per_second=total / least / GIGA if total else None,
            share_of_ceiling=ideal / least if ideal else None,
            peak_memory_mb=self.peaks.get(part),
            details=details,
        )


class _Run:
    """A workload that is timed; its first run is counted as well."""

    def __init__(self, work: Workload, device: str) -> None:
        self._work = work
        self._device = device
        self.operations: Mapping[str, Mapping[str, float]] | None = None

    def __call__(self) -> Seconds:
        if self.operations is None:
            with counted() as counter:
                watch = Stopwatch(self._device, counter)
                self._work.run(watch)
            self.operations = {
                part: {kind: count / self._work.times for kind, count in kinds.items()}
                for part, kinds in watch.operations.items()
            }
        else:
            watch = Stopwatch(self._device)
            self._work.run(watch)
        return {part: seconds / self._work.times for part, seconds in watch.seconds.items()}


def _measured(
    runs: Sequence[Row], prepared: Callable[[Row], Workload], done: Callable[[], None], repeats: int = REPEATS
) -> dict[Row, _Measured]:
    """Each of the runs measured, in turn."""
    found: dict[Row, _Measured] = {}
    going: dict[Row, _Run] = {}
    works: dict[Row, Workload] = {}
    for run in runs:
        try:
            works[run] = prepared(run)
            going[run] = _Run(works[run], run.device)
        except CannotMeasureError as error:
            found[run] = _Measured(reason=str(error))
    for run, times in measure(going, repeats=repeats, done=lambda key: done()).items():
        if isinstance(times, CannotMeasureError):
            found[run] = _Measured(reason=str(times))
            continue
        found[run] = _Measured(times, going[run].operations or {}, details=works[run].details())
        if run.device == "cuda":
            found[run].peaks = {WHOLE: _peak_on_gpu(going[run])}
    return {run: found[run] for run in runs}


def _peak_on_gpu(run: _Run) -> float:
    """The most memory of the GPU that one more run needs [10^6 bytes]."""
    torch.cuda.reset_peak_memory_stats()
    run()
    return torch.cuda.max_memory_allocated() / MEGABYTE


def _ceilings_for(rows: Sequence[Row]) -> list[Row]:
    """The ceilings that some of the rows are, or are compared with."""
    places = dict.fromkeys((row.threads, row.device) for row in rows if row.kind != "command")
    found = []
    for threads, device in places:
        halves = any(row.precision == "bfloat16" for row in rows if (row.threads, row.device) == (threads, device))
        for operation in OPERATIONS:
            found.append(ceiling_row(operation, "float32", threads, device))
            if halves:
                found.append(ceiling_row(operation, "bfloat16", threads, device))
    return found


def _looked_at(ceilings: Sequence[Row]) -> list[Row]:
    """Those ceilings that say whether there is hardware for bfloat16, which must be known first."""
    return [row for row in ceilings if row.part == "conv" and row.device == "cpu"]


def _speeds(ceilings: Sequence[Row], found: Mapping[Row, _Measured]) -> dict[str, float]:
    """GFLOP/s by a ceiling's name, of those that could be measured."""
    speeds = {row.name: found[row.run].speed(WHOLE) for row in ceilings}
    return {name: speed for name, speed in speeds.items() if speed is not None}


def _has_child(run: Row) -> bool:
    """Whether peak memory is measured in a process of its own."""
    return run.kind in IN_A_PROCESS_OF_ITS_OWN and run.device == "cpu"


def _without_hardware(run: Row, ceilings: Mapping[str, float]) -> bool:
    """Whether a run would compute in bfloat16 on a processor that has no hardware for it."""
    wants = run.kind != "ceiling" and run.precision == "bfloat16" and run.device == "cpu"
    known = ceiling("conv", "bfloat16", run.threads) in ceilings
    return wants and known and not has_bfloat16(ceilings, run.threads)


def _ideal_seconds(operations: Mapping[str, float], row: Row, ceilings: Mapping[str, float]) -> float | None:
    """The time that operations would take at the ceilings; None where one is not known.

    The plane sweep is compared with float32 convolutions: it has no operation of its own to be compared with.
    """
    seconds = 0.0
    for kind, count in operations.items():
        if not count:
            continue
        operation, precision = ("conv", "float32") if kind == "sweep" else (kind, row.precision)
        speed = ceilings.get(ceiling(operation, precision, row.threads, row.device))
        if not speed:
            return None
        seconds += count / GIGA / speed
    return seconds or None
