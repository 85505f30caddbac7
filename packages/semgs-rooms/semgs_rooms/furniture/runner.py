"""Run `program.py` in Infinigen's environment, one process per piece so that they are independent."""

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
from semgs_rooms.furniture.environment import python_of, surroundings
from semgs_rooms.furniture.kinds import PieceJob
from semgs_rooms.furniture.raw import Incomplete, RawMesh, read_raw

FAILED_TO_START = 1
"""Exit code of Python if the program itself fails, whatever the job."""

PATIENCE = 0.5
"""Interval at which a running program checks whether it should stop [s]."""


class OutOfTime(Incomplete):
    """A piece was not finished within its time limit; it may succeed on another try."""


def run_job(environment: Path, job: PieceJob, folder: Path, limit: float, stop: Event) -> list[RawMesh]:
    """Generate a piece and read it.

    Args:
        environment: folder of the environment.
        job: the piece.
        folder: for the program's files, which are removed afterwards.
        limit: maximum time [s].
        stop: ends the program soon after it is set.

    Raises:
        Incomplete: Infinigen could not generate the piece, or crashed.
        OutOfTime: it took too long.
        InputError: the environment does not work, or returns something other than a piece.
    """
    left = result, orders, log, reason = tuple(folder / f"{job.name}{end}" for end in (".npz", ".json", ".log", ".txt"))
    orders.write_text(json.dumps([job.as_json()]), encoding="utf-8")
    try:
        command = [
            str(python_of(environment)),
            str(files("semgs_rooms.furniture") / "program.py"),
            str(orders),
            str(folder),
        ]
        code = _run(command, environment, log, limit, stop)
        if result.is_file():
            return read_raw(result, len(job.makes))
        if reason.is_file():
            raise Incomplete(f"Infinigen: {reason.read_text(encoding='utf-8', errors='replace')[:300]}")
        if code == FAILED_TO_START:
            raise InputError(
                environment, "an environment in which Infinigen starts", _last_line(log), advice="remove it to create it again"
            )  # fmt: skip
        raise Incomplete(f"the program ended with {code} and no result")
    finally:
        for path in left:
            path.unlink(missing_ok=True)


def _run(command: list[str], environment: Path, log: Path, limit: float, stop: Event) -> int:
    """Run a command and return its exit code. After the time limit, or if `stop` is set, kill it and everything it started."""
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
            raise OutOfTime(f"not finished after {monotonic() - start:.0f} s")
        finally:
            _end(process)


def _end(process: subprocess.Popen) -> None:
    """Kill a process and everything it started."""
    if os.name == "nt":
        process.kill()
    else:
        with suppress(ProcessLookupError, PermissionError):
            os.killpg(process.pid, signal.SIGKILL)
    process.wait()


def _last_line(log: Path) -> str:
    lines = log.read_text(encoding="utf-8", errors="replace").strip().splitlines()
    return lines[-1][:300] if lines else "no output"
