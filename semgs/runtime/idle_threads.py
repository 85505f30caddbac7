"""Idle threads of OpenMP: on a busy machine, they must not take the time from those that have work."""

from __future__ import annotations

import os

SPINS = "3000"
"""How often an idle thread looks for work before it sleeps; OpenMP's default is 300,000."""


def let_idle_threads_sleep() -> None:
    """Let them sleep soon, unless the user has said how they wait. Without effect after torch was imported."""
    if "OMP_WAIT_POLICY" not in os.environ:
        os.environ.setdefault("GOMP_SPINCOUNT", SPINS)
