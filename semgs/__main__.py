"""`python -m semgs`, the same as the command `semgs`."""

from __future__ import annotations

import signal
import sys


def run() -> int:
    """The command of this process. Before `main` handles Ctrl-C, and after it, Ctrl-C ends the process without a traceback."""
    if signal.getsignal(signal.SIGINT) is signal.default_int_handler:
        signal.signal(signal.SIGINT, signal.SIG_DFL)
    from semgs.runtime.cores import prepare_threads

    prepare_threads()
    from semgs.cli.main import main

    return main()


if __name__ == "__main__":  # worker processes import this module under another name
    sys.exit(run())
