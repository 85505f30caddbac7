"""What a worker of `semgs batch` does: a command line, whose error becomes a record."""

from __future__ import annotations

import io
import signal
import threading
import traceback
from contextlib import redirect_stderr, redirect_stdout
from pathlib import Path
from time import perf_counter

from semgs.batch.records import Record
from semgs.batch.tasks import Task
from semgs.files.folders import MARK

ERROR = "semgs: error: "


def begin() -> None:
    """Set up a worker: one thread, Ctrl-C is for the run, and the worker ends with it."""
    import cv2
    import torch

    from semgs.runtime.workers import end_with_the_run

    torch.set_num_threads(1)
    cv2.setNumThreads(1)
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    threading.Thread(target=end_with_the_run, daemon=True).start()


def work(task: Task) -> Record:
    """Run the command line of a task. What it prints is dropped, but for its error."""
    from semgs.cli.main import main

    start, told = perf_counter(), io.StringIO()
    arguments = list(task.arguments)
    out = Path(arguments[arguments.index("--out") + 1]) if "--out" in arguments else Path(arguments[2])
    if (out / MARK).is_file():  # of an earlier call, whose record was not written, or with other options
        arguments.append("--overwrite")
    try:
        with redirect_stdout(io.StringIO()), redirect_stderr(told):
            code = main(arguments)
    except Exception:  # a fault of ours must not stop the batch
        code, lines = 1, traceback.format_exc().strip().splitlines()
        told.write(f"{ERROR}a fault of semgs: {lines[-1]}")
    lines = [line for line in told.getvalue().splitlines() if line.startswith(ERROR)]
    why = lines[-1].removeprefix(ERROR) if lines else ("" if code in (0, 3) else f"exit code {code}")
    return Record(task.name, task.fingerprint, code, why, round(perf_counter() - start, 3))
