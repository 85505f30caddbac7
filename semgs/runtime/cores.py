"""Cores that this process may use, how many of them other programs leave free, and as many threads.

On a busy machine, idle threads must not take the time from those that have work.
"""

from __future__ import annotations

import math
import os
import time
from collections.abc import Callable
from pathlib import Path

from semgs.runtime.control_groups import ROOT, control_groups, file_lines

TICKS_PER_SECOND = 100
"""Of the times in `/proc/stat`; they are the same on every Linux that torch runs on."""

SHORTEST_SECONDS = 0.2
"""A shorter time does not say how busy the machine is."""

USER, NICE, SYSTEM, IDLE, IO_WAIT = range(5)
"""Columns of `/proc/stat`; those after them, up to the eighth, are interrupts and time that other virtual machines take."""

SPINS = "3000"
"""How often an idle thread looks for work before it sleeps; OpenMP's default is 300,000."""

_meter: CoreMeter | None = None


def usable_cores(root: Path = ROOT) -> int:
    """Cores that this process may use: of the machine, of its affinity (`taskset`), and of the containers around it (`docker run --cpus`).

    Args:
        root: the folder with `proc` and the control groups.
    """
    quota = min((_quota(group) for group in control_groups("cpu", root)), default=math.inf)
    return max(1, int(min(len(_own_cores()), quota)))


class CoreMeter:
    """How busy other programs keep the cores that this process may use.

    Args:
        root: the folder with `proc` and the control groups.
        own_seconds: processor time of this process [s].
    """

    def __init__(self, root: Path = ROOT, own_seconds: Callable[[], float] = time.process_time) -> None:
        self._root, self._own_seconds = root, own_seconds
        self._before = self._read()

    def free_cores(self) -> int | None:
        """Cores that other programs left free since the last answer, at least 1; None if too little time has passed, or the system does not say.

        Programs with a lower priority (`nice`) do not count: they give way.
        """
        if self._before is None or (now := self._read()) is None:
            return None
        busy, total, own = (new - old for new, old in zip(now, self._before, strict=True))
        cores = len(_own_cores())
        if total < SHORTEST_SECONDS * cores:
            return None
        self._before = now
        others = cores * max(0.0, busy - own) / total
        return max(1, min(usable_cores(self._root), round(cores - others)))

    def _read(self) -> tuple[float, float, float] | None:
        """Seconds so far that the cores were busy, that they have been there, and that this process was busy."""
        own = {f"cpu{core}" for core in _own_cores()}
        lines = [line.split() for line in file_lines(self._root / "proc/stat")]
        times = [[int(ticks) / TICKS_PER_SECOND for ticks in line[1:9]] for line in lines if line and line[0] in own]
        if not times or any(len(core) < 8 for core in times):
            return None
        idle = sum(core[NICE] + core[IDLE] + core[IO_WAIT] for core in times)
        total = sum(map(sum, times))
        return total - idle, total, self._own_seconds()


def _own_cores() -> set[int]:
    """The numbers of the cores that the system may run this process on."""
    return os.sched_getaffinity(0) if hasattr(os, "sched_getaffinity") else set(range(os.cpu_count() or 1))


def _quota(group: Path) -> float:
    """Cores that a group may use, as a mean over time; infinite without a limit."""
    lines = file_lines(
        group / "cpu.max"
    )  # of version 2: microseconds of computing, or "max", and the period they are for
    if not lines:  # version 1
        lines = [
            " ".join(line for name in ("quota", "period") for line in file_lines(group / f"cpu.cfs_{name}_us")[:1])
        ]
    allowed, _, period = lines[0].partition(" ")
    if not (allowed.isdigit() and period.strip().isdigit() and int(period)):
        return math.inf
    return int(allowed) / int(period)


def prepare_threads() -> None:
    """Let idle threads sleep soon, and let `adapt_threads` choose their number. For commands, before torch is imported.

    What the user has set stays: `GOMP_SPINCOUNT` or `OMP_WAIT_POLICY` for how threads wait, `OMP_NUM_THREADS` for their number.
    """
    global _meter
    if "OMP_WAIT_POLICY" not in os.environ:
        os.environ.setdefault("GOMP_SPINCOUNT", SPINS)
    if "OMP_NUM_THREADS" not in os.environ:
        _meter = CoreMeter()


def adapt_threads() -> None:
    """Let torch compute with as many threads as cores are free; nothing changes in a process without `prepare_threads`.

    A thread that shares its core makes all others wait: on two cores with one other program, two threads take 1.0 s for what one does in 0.7 s.
    """
    free = None if _meter is None else _meter.free_cores()
    if free is not None:
        import torch

        torch.set_num_threads(free)
