"""`python -m semgs`, the same as the command `semgs`."""

from __future__ import annotations

import os
import signal
import sys

SPINS = "3000"
"""How often an idle thread of OpenMP looks for work before it sleeps. On a busy machine, the default of 300,000 takes the time from those that have work."""


def run() -> int:
    """The command of this process. Before `main` handles Ctrl-C, and after it, Ctrl-C ends the process without a traceback."""
    if "OMP_WAIT_POLICY" not in os.environ:
        os.environ.setdefault("GOMP_SPINCOUNT", SPINS)  # read when torch is imported
    if signal.getsignal(signal.SIGINT) is signal.default_int_handler:
        signal.signal(signal.SIGINT, signal.SIG_DFL)
    from semgs.cli.main import main

    return main()


if __name__ == "__main__":  # worker processes import this module under another name
    sys.exit(run())
