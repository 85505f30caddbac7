"""Ctrl-C before the command's first line and after its last: the process ends with its code, and prints no traceback."""

from __future__ import annotations

import os
import signal
import subprocess
import sys
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[2]
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


def test_little_is_imported_before_ctrl_c_is_handled(tmp_path: Path) -> None:
    """Until then it prints a traceback. Without site, because packages may import more at every start of Python."""
    program = "import sys; before = set(sys.modules); import semgs.__main__; print(*sorted(set(sys.modules) - before))"
    done = subprocess.run(
        [sys.executable, "-S", "-c", program],
        capture_output=True,
        text=True,
        check=True,
        cwd=ROOT,
        env={**os.environ, "PYTHONPATH": str(ROOT)},
    )
    ours = [name for name in done.stdout.split() if name.startswith("semgs")]
    assert ours == ["semgs", "semgs.__main__", "semgs._version"]
    assert not {"typing", "contextlib", "dataclasses", "argparse"} & set(done.stdout.split())


@pytest.mark.skipif(sys.platform == "win32", reason="signals of Unix")
def test_an_interrupt_after_the_last_line_prints_no_traceback(tmp_path: Path) -> None:
    program = f"import sys; from semgs.__main__ import run; sys.argv[1:] = ['--version']; run(); {INTERRUPT}"
    done = run(tmp_path, program)
    assert (done.returncode, done.stderr) == (-signal.SIGINT, b"")
    assert done.stdout.startswith(b"semgs ")
