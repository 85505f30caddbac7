"""What a worker of `semgs batch` does: a task, whose error becomes a record; and what the table shows of its result: scores, notes and a small picture."""

from __future__ import annotations

import io
import os
import shutil
import signal
from collections.abc import Iterator
from contextlib import redirect_stderr, redirect_stdout, suppress
from dataclasses import replace
from pathlib import Path
from time import perf_counter
from traceback import format_exception_only

import cv2
import numpy as np
from jaxtyping import UInt8

from semgs.batch.records import FOLDER, PICTURES, Record, write_record
from semgs.batch.tasks import PLACES, Task
from semgs.files.atomic import write_bytes
from semgs.files.folders import staged
from semgs.files.images.pictures import jpeg_bytes, read_rgb
from semgs.files.strict_json import read_json
from semgs.files.text import printable
from semgs.run.outcome import Outcome
from semgs.run.usage_errors import BAD_INPUT, line_for
from semgs.runtime.notes import Progress

MOST_NOTES = 40
"""Notes that are kept of a scene."""

BUG = 1
"""The code of a scene at which we failed."""

SCORES = ("psnr", "miou", "accuracy", "depth_error")
"""The scores of a report that are shown, if it has them."""

WIDTH, QUALITY = 160, 80
"""Width of a picture [px], and its JPEG quality."""

REPORTED = ("reconstruct", "label-splat")
"""Commands that write a report."""


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
    """Run a task, and write its record and its picture. What libraries print is dropped.

    Raises:
        OSError: the record cannot be written.
    """
    (task.out / FOLDER / f"{task.name}.json").unlink(missing_ok=True)
    start = perf_counter()
    try:
        with redirect_stdout(io.StringIO()), redirect_stderr(io.StringIO()):
            outcome = _run(task)
    except Exception as error:  # one scene must not stop the batch
        line = line_for(error)
        code, why = (
            (BUG, f"a fault of semgs: {format_exception_only(error)[-1].strip()}")
            if line is None
            else (BAD_INPUT, line)
        )
        outcome = Outcome(lacking=(why,), code=code)
    why = printable("; ".join(" ".join(line.split()) for line in outcome.lacking))
    record = Record(task.name, task.fingerprint, outcome.code, why, round(perf_counter() - start, 3))
    if record.succeeded:
        record = _described(task, record, outcome)
    write_record(task.out, record)
    return record


def _run(task: Task) -> Outcome:
    """Run a task. A result of an earlier call, with other options or without its record, is replaced."""
    result, (_, target), options = task.out / task.result, PLACES[task.command], task.options
    if task.command != "label":
        return replace(options, **{"overwrite": result.exists()}).run(Progress())
    # It fills its folder in several steps, so it gets another one until it has succeeded.
    result.parent.mkdir(parents=True, exist_ok=True)
    with staged(result) as part:
        outcome = replace(options, **{target: part}).run(Progress())
        shutil.rmtree(result, ignore_errors=True)
        part.rename(result)
        return outcome


def _described(task: Task, record: Record, outcome: Outcome) -> Record:
    """The record with what the table of the batch shows. A scene without a picture is no failure."""
    scores, notes = read_scores(task), outcome.notes[:MOST_NOTES]
    with suppress(ValueError, OSError):
        write_picture(task, task.out / PICTURES / f"{task.name}.jpg")
    return replace(record, scores=scores, notes=tuple(map(printable, notes)))


def read_scores(task: Task) -> dict[str, float]:
    """Mean scores of the held-out views, or of the input views if there are none, of a report; nothing for other commands.

    Raises:
        InputError: the report is damaged.
    """
    if task.command not in REPORTED:
        return {}
    report = read_json(task.out / task.result / "report.json", "a report")
    means = report["means"]["target"] or report["means"]["context"]
    scores = {name: float(means[name]) for name in SCORES if means.get(name) is not None}
    return {**scores, "gaussians": float(report["gaussians"])}


def write_picture(task: Task, path: Path) -> None:
    """Write a small picture: the first held-out rendering, or a photo of the scene; nothing if there is neither.

    Raises:
        InputError: an image is damaged.
        OSError: it cannot be written.
    """
    pixels = next(_images(task), None)
    if pixels is None:
        return
    size = (WIDTH, max(1, round(WIDTH * pixels.shape[0] / pixels.shape[1])))
    small = cv2.resize(pixels, size, interpolation=cv2.INTER_AREA)
    path.parent.mkdir(exist_ok=True)
    write_bytes(path, jpeg_bytes(small, QUALITY))


def _images(task: Task) -> Iterator[UInt8[np.ndarray, "h w 3"]]:
    """Images of a scene, the best one first."""
    result = task.out / task.result
    renders = (task.scene if task.command == "export" else result) / "renders"
    for pattern in ("target_*_image.png", "context_*_image.png"):
        yield from map(read_rgb, sorted(renders.glob(pattern)))
    if task.command == "poses":
        yield from map(read_rgb, sorted((result / "images").glob("*")))
    elif task.command in ("doctor", "label"):
        from semgs.data.scenes import open_scene

        yield from (frame.read_image() for frame in open_scene(task.scene).frames)
