"""Starts a command of the workshop as `semgs` starts its own: one line and exit code 2 for bad input."""

from __future__ import annotations

import sys
from collections.abc import Sequence
from typing import Any

from semgs.cli.main import run_command, run_guarded


def run(options: type[Any], name: str, arguments: Sequence[str] | None = None) -> int:
    """Run a command and return its exit code.

    Args:
        options: the dataclass of its options.
        name: of its package.
        arguments: without the program's name; None takes those of the process.
    """
    given = sys.argv[1:] if arguments is None else arguments
    return run_guarded(lambda: run_command(options, f"python -m paper.{name}", given))
