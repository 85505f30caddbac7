"""Ctrl-C before the command's first line and after its last: the process ends with its code, and prints no traceback."""

from __future__ import annotations

import os
import signal
import subprocess
import sys
from pathlib import Path

import pytest

INTERRUPT = "import os, signal; os.kill(os.getpid(), signal.SIGINT)"


def run(folder: Path, program: str) -> subprocess.CompletedProcess[bytes]:
    """A program that has Python's usual handler of Ctrl-C."""
    start = "import signal; signal.signal(signal.SIGINT, signal.default_int_handler)\n"
    path = os.pathsep.join(filter(None, (str(folder), os.environ.get("PYTHONPATH", str(Path.cwd())))))
    return subprocess.run(
        [sys.executable, "-c", start + program],
        capture_output=True,
        check=False,
        env={**os.environ, "PYTHONPATH": path},
    )


@pytest.mark.skipif(sys.platform == "win32", reason="signals of Unix")
def test_an_interrupt_while_the_first_modules_are_imported_prints_no_traceback(tmp_path: Path) -> None:
    program = (
        "import sys, builtins, os, signal\n"
        "usual = builtins.__import__\n"
        "def importing(name, *rest):\n"
        "    if name == 'semgs.cli.terminal': os.kill(os.getpid(), signal.SIGINT)\n"
        "    return usual(name, *rest)\n"
        "builtins.__import__ = importing\n"
        "from semgs.__main__ import run\n"
        "sys.argv[1:] = ['--version']\n"
        "sys.exit(run())"
    )
    done = run(tmp_path, program)
    assert (done.returncode, done.stderr) == (-signal.SIGINT, b"")


@pytest.mark.skipif(sys.platform == "win32", reason="signals of Unix")
def test_an_interrupt_after_the_last_line_prints_no_traceback(tmp_path: Path) -> None:
    program = f"import sys; from semgs.__main__ import run; sys.argv[1:] = ['--version']; run(); {INTERRUPT}"
    done = run(tmp_path, program)
    assert (done.returncode, done.stderr) == (-signal.SIGINT, b"")
    assert done.stdout.startswith(b"semgs ")
