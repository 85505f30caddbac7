"""What a worker of `semgs batch` does: a command line, whose error becomes a record."""

from __future__ import annotations

import io
import os
import shutil
import signal
import traceback
from contextlib import redirect_stderr, redirect_stdout, suppress
from dataclasses import replace
from pathlib import Path
from time import perf_counter

from semgs.batch.records import FOLDER, PICTURES, Record, write_record
from semgs.batch.tasks import Task
from semgs.files.errors import ERROR_LINE
from semgs.files.folders import staged

MOST_NOTES = 10
"""Lines of what a command printed that are kept as notes."""


def begin(folder: str) -> None:
    """Set up a worker process of this machine: as `settle`, and it ends with the run or by SIGTERM.

    Args:
        folder: the working folder of the run.
    """
    from semgs.runtime.workers import settle_worker

    settle_worker()
    signal.signal(signal.SIGTERM, signal.SIG_DFL)
    settle(folder)


def settle(folder: str) -> None:
    """Let this process work as the run does: in its folder, with one thread, and with networks that stay loaded."""
    from semgs.runtime.kept import keep_loaded
    from semgs.runtime.workers import use_one_thread

    use_one_thread()
    os.chdir(folder)
    keep_loaded()


def work(task: Task) -> Record:
    """Run the command line of a task, and write its record and its picture. What it prints is dropped, but for its error and last lines.

    Raises:
        OSError: the record cannot be written.
    """
    (task.out / FOLDER / f"{task.name}.json").unlink(missing_ok=True)
    start, errors, printed = perf_counter(), io.StringIO(), io.StringIO()
    try:
        with redirect_stdout(printed), redirect_stderr(errors):
            code = _run(task)
    except Exception:  # a fault of ours must not stop the batch
        code = 1
        errors.write(f"{ERROR_LINE}a fault of semgs: {traceback.format_exc().strip().splitlines()[-1]}")
    if code >= 128:  # a signal
        os._exit(code)
    record = Record(task.name, task.fingerprint, code, seconds=round(perf_counter() - start, 3))
    lines = [line.removeprefix(ERROR_LINE) for line in errors.getvalue().splitlines() if line.startswith(ERROR_LINE)]
    if record.succeeded:
        record = replace(_described(task, record, printed.getvalue()), why="; ".join(lines))
    else:
        record = replace(record, why=lines[-1] if lines else f"exit code {code}")
    write_record(task.out, record)
    return record


def _run(task: Task) -> int:
    """Run the command and return its exit code. A result of an earlier call, with other options or without its record, is replaced."""
    from semgs.cli.main import main

    result = task.out / task.result
    if task.command != "label":
        return main([*task.arguments, "--overwrite"] if result.exists() else task.arguments)
    # It fills its folder in several steps, so it gets another one until it has succeeded.
    result.parent.mkdir(parents=True, exist_ok=True)
    with staged(result) as part:
        code = main([str(part) if Path(word).absolute() == result.absolute() else word for word in task.arguments])
        if code == 0:
            shutil.rmtree(result, ignore_errors=True)
            part.rename(result)
        return code


def _described(task: Task, record: Record, printed: str) -> Record:
    """The record with what the table of the batch shows. A scene without a picture is no failure."""
    from semgs.batch.results import REPORTED, read_scores, write_picture

    scores, notes = read_scores(task)
    if task.command not in REPORTED:
        last = printed.strip().rpartition("\n\n")[2].splitlines()
        notes = tuple(line for line in last if str(task.out) not in line)[:MOST_NOTES]
    with suppress(ValueError, OSError):
        write_picture(task, task.out / PICTURES / f"{task.name}.jpg")
    return replace(record, scores=scores, notes=notes)
