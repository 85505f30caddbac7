"""The log of a run: JSON lines and TensorBoard events on disk, progress and the time left on a console.

torch's SummaryWriter writes events in a thread of its own, which prints a traceback when the disk is full. `Events` writes them in the calling thread.
"""

from __future__ import annotations

import json
import math
import os
import socket
import sys
import time
from collections.abc import Iterable
from contextlib import ExitStack, suppress
from dataclasses import asdict
from pathlib import Path
from types import ModuleType, TracebackType
from typing import Any

import numpy as np
import torch
from rich.console import Console
from rich.progress import BarColumn, MofNCompleteColumn, Progress, TextColumn, TimeElapsedColumn, TimeRemainingColumn

from semgs.files.atomic import write_bytes
from semgs.files.strict_json import parse_json
from semgs.files.text import counted, printable
from semgs.training.state import StepReport
from semgs.training.supervision.validation import Validation

EVERY = 20
"""Steps that are averaged for one line of the log."""

DAMAGED = "log.damaged.jsonl"
"""File for lines of the log that a crash has damaged."""

PLAIN_LINE_SECONDS = 30.0
"""Time between lines on a console that is not a terminal."""


LOG = "log.jsonl"


def read_validations(run: Path, score: str) -> dict[int, float]:
    """A score of the validations in a run's log, by step. Lines that cannot be read, and a score that is missing, are left out."""
    found = {}
    for line in _lines(run / LOG):
        if record := _record_of(line):
            value = record.get("validation", {}).get(score)
            if value is not None:
                found[record["step"]] = float(value)
    return found


class RunLog:
    """Writes the measurements of steps and validations; a context manager around the loop.

    Args:
        out: the run folder, for log.jsonl and tensorboard/; None writes nothing. Lines after `step`, which a killed run may have left,
            are dropped, and those of step 0 if it begins there again. Lines that cannot be read are moved to `DAMAGED`.
        step: where the run starts or resumes.
        steps: its last step.
        console: where progress is shown; None shows nothing.
    """

    def __init__(self, out: Path | None, step: int, steps: int, console: Console | None) -> None:
        self._file = self._events = None
        if out is not None:
            last = step or -1  # a run that begins at step 0 validates there
            path = out / LOG
            lines = [(_record_of(line), line) for line in _lines(path)]
            if damaged := [line for record, line in lines if record is None]:
                with (out / DAMAGED).open("ab") as aside:
                    aside.writelines(damaged)
                print_lines(console, [f"{path}: moved {counted(len(damaged), 'unreadable line')} to {DAMAGED}"])
            kept = [line for record, line in lines if record is not None and record["step"] <= last]
            write_bytes(path, b"".join(kept))
            self._file = path.open("a")
            self._events = _events(out / "tensorboard", last)
        self._start, self._steps, self._console = step, steps, console
        self._reports: list[StepReport] = []
        self._waited = self._samples = 0.0
        self._began = self._since = self._shown = time.monotonic()
        self._latest = (step, 0.0, 0, 0)
        self._bar: Progress | None = None
        if console is not None and console.is_terminal:
            self._bar = Progress(
                TextColumn("{task.description}"), BarColumn(), MofNCompleteColumn(), TimeElapsedColumn(),
                TimeRemainingColumn(), console=console,
            )  # fmt: skip
            self._task = self._bar.add_task("training", total=steps, completed=step)

    def __enter__(self) -> RunLog:
        if self._bar is not None:
            self._bar.start()
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        if self._reports:
            self._flush()
        if self._bar is not None:
            self._bar.stop()
        with ExitStack() as closing:  # closes the second file even if the disk is too full to close the first
            for file in (self._file, self._events):
                if file is not None:
                    closing.callback(file.close)

    def step(
        self, step: int, seconds: float, report: StepReport, scenes: int, waited: float, skipped: int, bad: int = 0
    ) -> None:
        """Log a step.

        Args:
            step: steps taken so far.
            seconds: time that the run has taken so far.
            report: the step's measurements.
            scenes: number of scenes in its batch, over all processes.
            waited: time spent waiting for its batch [s].
            skipped: steps skipped so far.
            bad: scenes that could not be read so far.
        """
        self._reports.append(report)
        self._samples += scenes
        self._waited += waited
        self._latest = (step, seconds, skipped, bad)
        if self._bar is not None:
            self._bar.update(self._task, completed=step)
        if len(self._reports) >= EVERY or step == self._steps:
            self._flush()

    def validation(self, step: int, result: Validation) -> None:
        """Log a validation."""
        self._write({"step": step, "validation": result.numbers}, result.pictures)
        self.say(f"step {step}: validation {', '.join(result.phrases)}")

    def say(self, sentence: str) -> None:
        """Show a sentence on the console."""
        print_lines(self._console, [sentence])

    def _flush(self) -> None:
        """Write and show the means since the last line."""
        step, seconds, skipped, bad = self._latest
        now = time.monotonic()
        moved = [report for report in self._reports if report.moved] or self._reports
        names = [name for name in asdict(moved[0]) if name not in ("moved", "unlabelled")]
        means = {name: sum(float(getattr(report, name)) for report in moved) / len(moved) for name in names}
        elapsed = max(now - self._since, 1e-9)
        numbers = {
            "step": step,
            **means,
            "unlabelled": sum(report.unlabelled for report in self._reports),
            "skipped": skipped,
            "bad_scenes": bad,
            "samples_per_second": self._samples / elapsed,
            "wait_share": self._waited / elapsed,
            "seconds": seconds,
            "memory_gb": memory_gb(),
        }
        self._write(numbers)
        losses = f"loss {means['total']:.4f}"
        if math.isfinite(means["psnr"]):
            losses += f", PSNR {means['psnr']:.2f} dB"
        if self._bar is not None:
            self._bar.update(self._task, description=losses)
        elif now - self._shown >= PLAIN_LINE_SECONDS or step == self._steps:
            left = (now - self._began) / max(step - self._start, 1) * (self._steps - step) / 60
            self.say(
                f"step {step} of {self._steps}: {losses}, {numbers['samples_per_second']:.2f} scenes/s, "
                f"{100 * numbers['wait_share']:.0f} % waiting for data, about {left:.0f} min left"
            )
            self._shown = now
        self._reports, self._waited, self._samples, self._since = [], 0.0, 0.0, now

    def _write(self, numbers: dict, pictures: np.ndarray | None = None) -> None:
        """Append a line of JSON; numbers that are not finite become null."""
        if self._file is None:
            return
        self._file.write(json.dumps(_finite(numbers)) + "\n")
        self._file.flush()
        if self._events is not None:
            step = numbers["step"]
            groups = {name: values for name, values in numbers.items() if isinstance(values, dict)}
            for group, values in (groups or {"training": numbers}).items():
                for name, value in values.items():
                    if name != "step" and value is not None:
                        self._events.number(f"{group}/{name}", value, step)
            if pictures is not None:
                self._events.image("validation", pictures, step)
            self._events.flush()


def print_lines(console: Console | None, sentences: Iterable[str]) -> None:
    """Print sentences, if there is a console."""
    if console is not None:
        for sentence in sentences:
            console.print(printable(sentence), markup=False, highlight=False, soft_wrap=True)


def memory_gb() -> float:
    """Peak memory: of the GPU if one is used, else of this process [GB]."""
    if torch.cuda.is_available() and torch.cuda.is_initialized():
        return torch.cuda.max_memory_allocated() / 1e9
    try:
        import resource
    except ImportError:  # not on Windows
        return math.nan
    # In kilobytes, but in bytes on macOS.
    return resource.getrusage(resource.RUSAGE_SELF).ru_maxrss * (1 if sys.platform == "darwin" else 1024) / 1e9


def _events(folder: Path, step: int) -> Events | None:
    """Events for TensorBoard, without those that an earlier session wrote after `step`; None if TensorBoard is not installed."""
    try:
        return Events(folder, step)
    except ImportError:
        return None


def _finite(value: object) -> object:
    """The value with floats rounded to five significant digits, and None for those that are not finite."""
    if isinstance(value, dict):
        return {name: _finite(number) for name, number in value.items()}
    if isinstance(value, float):
        return float(f"{value:.5g}") if math.isfinite(value) else None
    return value


def _lines(path: Path) -> list[bytes]:
    """The complete lines of a file with their ends; a last line that was cut short does not count."""
    content = path.read_bytes() if path.exists() else b""
    return content[: content.rfind(b"\n") + 1].splitlines(keepends=True)


def _record_of(line: bytes) -> dict[str, Any] | None:
    """A line of the log, None if it cannot be read or names no step."""
    try:
        record = parse_json(line)
    except ValueError:
        return None
    return record if isinstance(record, dict) and type(record.get("step")) is int else None


class Events:
    """An event file. Numbers and images are in it for certain after `flush`.

    Args:
        folder: where to create it; TensorBoard shows all event files of a folder as one run.
        step: the last step of earlier event files that still counts; TensorBoard drops the later ones.

    Raises:
        ImportError: TensorBoard is not installed.
        OSError: the file cannot be written. The methods raise it too.
    """

    def __init__(self, folder: Path, step: int) -> None:
        from tensorboard.compat.proto import event_pb2
        from tensorboard.summary.writer.record_writer import RecordWriter
        from torch.utils.tensorboard import summary

        self._summary: ModuleType = summary
        self._event: Any = event_pb2.Event
        folder.mkdir(parents=True, exist_ok=True)
        name = f"events.out.tfevents.{int(time.time()):010d}.{socket.gethostname()}.{os.getpid()}.{time.monotonic_ns()}"
        self._records = RecordWriter((folder / name).open("wb"))
        self._write(file_version="brain.Event:2")
        started = event_pb2.SessionLog(status=event_pb2.SessionLog.START)
        self._write(step=step + 1, session_log=started)
        try:
            self.flush()
        except OSError:
            with suppress(OSError):  # the same error again; without a close, Python prints it later
                self.close()
            raise

    def number(self, name: str, value: float | int, step: int) -> None:
        """Add a number."""
        self._write(step=step, summary=self._summary.scalar(name, value))

    def image(self, name: str, image: np.ndarray, step: int) -> None:
        """Add an image [h w 3]: uint8, or floats from 0 to 1."""
        self._write(step=step, summary=self._summary.image(name, image, dataformats="HWC"))

    def flush(self) -> None:
        """Hand everything to the system."""
        self._records.flush()

    def close(self) -> None:
        """Close the file."""
        self._records.close()

    def _write(self, **fields: Any) -> None:
        self._records.write(self._event(wall_time=time.time(), **fields).SerializeToString())
