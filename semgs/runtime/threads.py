"""Threads of a command on a busy machine: idle ones must not take the time from those that have work, and there are as many as cores are free."""

from __future__ import annotations

import os

from semgs.runtime.cores import CoreMeter

SPINS = "3000"
"""How often an idle thread looks for work before it sleeps; OpenMP's default is 300,000."""

_meter: CoreMeter | None = None


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
