"""Runs the program in the other environment: a process for each piece, so that none can spoil another."""

from __future__ import annotations

import json
import os
import signal
import subprocess
from contextlib import suppress
from importlib.resources import files
from pathlib import Path
from threading import Event
from time import monotonic

from semgs.files.errors import InputError
from tools.furniture.environment import python_of, surroundings
from tools.furniture.kinds import Job
from tools.furniture.raw import Incomplete, RawMesh, read_raw

FAILED_TO_START = 1
"""How Python ends when the program itself falls over, whatever the job."""


PATIENCE = 0.5
"""Between looks at whether all is to stop [s]."""


class OutOfTime(Incomplete):
    """A piece that was not made within its time; another machine, or another hour, may have it."""


def run_job(environment: Path, job: Job, folder: Path, limit: float, stop: Event) -> list[RawMesh]:
    """Have a piece made, and read it.

    Args:
        environment: folder of the environment.
        job: what to make.
        folder: where the program works; what is left of the job in it is removed.
        limit: longest that it may take [s].
        stop: ends it at once when it is set.

    Raises:
        Incomplete: Infinigen could not make it, or fell over.
        OutOfTime: it took longer.
        InputError: the environment does not work, or hands over something else than a piece.
    """
    left = result, orders, log, reason = tuple(folder / f"{job.name}{end}" for end in (".npz", ".json", ".log", ".txt"))
    orders.write_text(json.dumps([job.as_json()]), encoding="utf-8")
    try:
        command = [str(python_of(environment)), str(files("tools.furniture") / "program.py"), str(orders), str(folder)]
        code = _run(command, environment, log, limit, stop)
        if result.is_file():
            return read_raw(result, len(job.makes))
        if reason.is_file():
            raise Incomplete(f"Infinigen: {reason.read_text(encoding='utf-8', errors='replace')[:300]}")
        if code == FAILED_TO_START:
            raise InputError(
                environment, "an environment in which Infinigen starts", _last_line(log), advice="remove it to have it made anew"
            )  # fmt: skip
        raise Incomplete(f"the program ended with {code} and made nothing")
    finally:
        for path in left:
            path.unlink(missing_ok=True)


def _run(command: list[str], environment: Path, log: Path, limit: float, stop: Event) -> int:
    """Run a command to its end, or end it and all that it started.

    Raises:
        OutOfTime: it took longer than the limit.
        InputError: it cannot be started.
    """
    with log.open("wb") as said:
        try:
            process = subprocess.Popen(
                command, stdin=subprocess.DEVNULL, stdout=said, stderr=subprocess.STDOUT, env=surroundings(environment),
                start_new_session=True,
            )  # fmt: skip
        except OSError as error:
            raise InputError(environment, "an environment with a Python", str(error)) from error
        start = monotonic()
        try:
            while not stop.is_set() and (left := start + limit - monotonic()) > 0:
                with suppress(subprocess.TimeoutExpired):
                    return process.wait(min(left, PATIENCE))
            raise OutOfTime(f"not done after {monotonic() - start:.0f} s")
        finally:
            _end(process)


def _end(process: subprocess.Popen) -> None:
    """End a process and what it started."""
    if os.name == "nt":
        process.kill()
    else:
        with suppress(ProcessLookupError, PermissionError):
            os.killpg(process.pid, signal.SIGKILL)
    process.wait()


def _last_line(log: Path) -> str:
    lines = log.read_text(encoding="utf-8", errors="replace").strip().splitlines()
    return lines[-1][:300] if lines else "nothing said"
