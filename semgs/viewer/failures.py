"""Failures of a server: one line in the terminal, of the same place of the code once a minute."""

from __future__ import annotations

import logging
import sys
import time
import warnings
from math import inf
from pathlib import Path

from semgs.files.text import printable

QUIET_SECONDS = 60.0
"""At most one failure at a place of the code is printed in this time."""

MOST_LETTERS = 300
"""Of a line."""

_told: dict[str, float] = {}
"""When a failure was last told, by its place in the code."""


def tell_failure(error: BaseException) -> None:
    """Tell whoever runs a server of a request that failed, on one line with the place in the code; of the same place once a minute."""
    if type(error).__name__ == "ClientDisconnect":  # of Starlette: a browser went away
        return
    trace = error.__traceback__
    while trace is not None and trace.tb_next is not None:
        trace = trace.tb_next
    place = "" if trace is None else f" at {Path(trace.tb_frame.f_code.co_filename).name}:{trace.tb_lineno}"
    _tell(place, f"a request failed: {type(error).__name__}{place}: {error}")


def quieten_libraries() -> None:
    """From now on, what libraries log or warn of is one line in the terminal, and of the same library one a minute: some do so for each damaged request."""
    logging.lastResort = _OnOneLine(logging.WARNING)
    warnings.filterwarnings("ignore", module=r"viser\.infra")  # Python keeps each text


class _OnOneLine(logging.Handler):
    """Prints records."""

    def emit(self, record: logging.LogRecord) -> None:
        _tell(record.name, f"{record.name}: {record.getMessage()}")


def _tell(place: str, text: str) -> None:
    """Print a line, unless one of the same place was printed a short time ago."""
    now = time.monotonic()
    if now - _told.get(place, -inf) < QUIET_SECONDS:
        return
    _told[place] = now
    try:
        print(printable(f"semgs: {' '.join(text.split())[:MOST_LETTERS]}"), file=sys.stderr, flush=True)
    except (OSError, ValueError):  # there is no terminal any more
        return
