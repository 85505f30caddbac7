"""The queue of the app: one job at a time, each in a worker process of its own.

A worker is started before there is a job for it, because importing torch takes seconds. It reads a request as one line of JSON from stdin, and ends with the job, so
nothing of a job stays in memory. On stderr it reports stages as JSON ({"stage": title, "done": 2, "of": 8}), and why a job cannot be done ({"refused": sentence}).
With the first stage it has begun. One that ends earlier is replaced by another, a few times for each job.

Each job has a folder: `room` with the result, which appears once it is complete, and `files` with the uploads. These stay for some time beside a result, so that
it can be made again with other options; then they move on to the new one. They are deleted when a job fails and when the app ends.
"""

from __future__ import annotations

import itertools
import json
import os
import re
import secrets
import shutil
import signal
import subprocess
import sys
import threading
import time
import traceback
from collections import deque
from collections.abc import Sequence
from contextlib import suppress
from dataclasses import asdict, dataclass, field
from pathlib import Path
from typing import Any, Literal

from semgs.app.limits import Limits
from semgs.app.requests import Request, RoomOptions
from semgs.app.uploads import GONE, UnusableUploadError, Upload, check_uploads, content_of, link_or_copy, size_of
from semgs.files.strict_json import parse_json
from semgs.files.text import counted, printable
from semgs.runtime.free_memory import free_bytes, group_bytes

State = Literal["waiting", "working", "done", "failed", "cancelled"]

FILES, WORK, ROOM = "files", "work", "room"

TEMPORARY = "temporary"
"""The folder beside those of jobs with a worker's temporary files. It is emptied before the next one starts: a worker that is killed cannot do it."""

LOG_LINES = 200

MOST_LINE = 4096
"""So much of a line of a worker is kept [letters]: it may contain names from data, of any length."""

SWEEP_SECONDS = 60.0
"""How often expired results are looked for."""

UPLOAD_SECONDS = 3600.0
"""Uploads that no job used are deleted after this time."""

STOP_SECONDS = 8.0
"""A worker has this long to end when it is asked to; then it is killed."""

WATCH_SECONDS = 0.2
"""How often a worker's memory is measured."""

DISK_SECONDS = 2.0
"""How often its files are measured."""

FREE_SHARE = 0.9
"""A job may take this share of the memory that is free when it starts, so that the system never has to choose what it kills."""

FORGOTTEN_SECONDS = 600.0
"""Failed and cancelled jobs are forgotten after this time."""

TRIES = 3
"""A job fails if so many workers in a row end before they have begun it."""

IDENTIFIER = re.compile(r"[a-z0-9]{20}")

BUG = "SemGS failed on these files, and this is a bug. The details are in the terminal where semgs app runs."
KILLED = "The work was stopped by the system, probably because memory ran out. Try fewer or smaller files."
TOO_MUCH = (
    "This needed more than {gb:.1f} GB of memory, so it was stopped. Use fewer or smaller files, or a shorter clip."
)
TOO_LARGE = (
    "This needed more than {gb:.1f} GB of disk, so it was stopped. Use fewer or smaller files, or a shorter clip."
)
LATE = "This took more than {minutes:.0f} minutes, so it was stopped. Use fewer photos, or a shorter clip."
NO_WORKER = f"The work could not be started in {TRIES} tries. Try again in some minutes. The reason is in the terminal where semgs app runs."


@dataclass
class Stage:
    """A stage of a job: what is done, since when, and how far it is."""

    title: str
    start: float
    seconds: float | None = None
    done: int = 0
    of: int = 0


@dataclass
class Job:
    """A job and what became of it.

    Attributes:
        identifier: unguessable, and the name of its folder.
        folder: of the job.
        request: what the worker gets.
        title: what it is made from, in words.
        sources: the files as uploaded, or as kept with an earlier result; deleted when the room is ready.
        page: which wants it; empty if it is not known.
        state: where it is.
        stages: in order; all but the last are finished.
        sentence: why it failed.
        refusal: why the worker cannot do it, as it says; empty until then.
        started: when a worker took it [s]; 0 before.
        ended: when it was over [s]; 0 before.
        pages: how many pages have followed it.
        earlier: the identifier of the result that it makes again; empty if there is none.
    """

    identifier: str
    folder: Path
    request: Request
    title: str
    sources: tuple[Path, ...] = ()
    page: str = ""
    state: State = "waiting"
    stages: list[Stage] = field(default_factory=list)
    sentence: str = ""
    refusal: str = ""
    started: float = 0.0
    ended: float = 0.0
    pages: int = 0
    earlier: str = ""

    @property
    def room(self) -> Path:
        """The folder of its result."""
        return self.folder / ROOM

    @property
    def over(self) -> bool:
        """Whether nothing will change any more."""
        return self.state in ("done", "failed", "cancelled")

    @property
    def uploads(self) -> list[Upload]:
        """Its files, as long as they are kept."""
        return [Upload(Path(path), name) for path, name in self.request.files]

    @property
    def repeatable(self) -> bool:
        """Whether it can be made again: its files are still there, and it is of this run of the app."""
        known = self.state == "done" and bool(self.request.options)
        return known and all(one.path.is_file() for one in self.uploads)


class Jobs:
    """The queue.

    Args:
        folder: for results, a folder for each job.
        worker: the command that starts a worker.
        limits: of uploads, time and the queue.
        segmenters, depths: what jobs may choose beside the included ones.
        uploads: folder for what browsers send, by default beside the results; emptied of what no job needed for an hour.
    """

    def __init__(
        self,
        folder: Path,
        worker: Sequence[str],
        limits: Limits | None = None,
        segmenters: tuple[str, ...] = (),
        depths: tuple[str, ...] = (),
        uploads: Path | None = None,
    ) -> None:
        self.folder, self.limits = folder, limits or Limits()
        self.uploads = uploads or folder / "uploads"
        self.segmenters, self.depths = segmenters, depths
        self._worker = list(worker)
        self._jobs: dict[str, Job] = {}
        self._queue: deque[Job] = deque()
        self._lock = threading.Condition()
        self._entry = threading.Lock()
        self._spare: subprocess.Popen[str] | None = None
        self._running: Job | None = None
        self._process: subprocess.Popen[str] | None = None
        self._closed = False
        folder.mkdir(parents=True, exist_ok=True)
        shutil.rmtree(self.uploads, ignore_errors=True)
        self.uploads.mkdir(parents=True)
        self._read_earlier()
        self._threads = [
            threading.Thread(target=target, daemon=True, name=target.__name__) for target in (self._work, self._sweep)
        ]
        for thread in self._threads:
            thread.start()

    def close(self) -> None:
        """Stop the worker, and everything that waits."""
        with self._lock:
            self._closed = True
            spare = self._spare
            self._lock.notify_all()
        for process in (self._process, spare):
            if process is not None:
                _stop(process)
        for thread in self._threads:
            thread.join(STOP_SECONDS)
        if spare is not None:
            _close(spare)
        for kept in (self.folder / TEMPORARY, *(job.folder / FILES for job in self._jobs.values())):
            shutil.rmtree(kept, ignore_errors=True)

    def submit(
        self,
        uploads: Sequence[Upload],
        options: RoomOptions | None = None,
        example: bool = False,
        page: str = "",
        earlier: str = "",
    ) -> Job:
        """Put a job into the queue. The files stay until a room is made of them, so that another try is possible.

        Args:
            uploads: the files.
            options: of the room.
            example: make the included room, without files.
            page: which wants it; with a second click it gets its job again, unless that is over.
            earlier: the identifier of a job that is made again, whose uploads these are.

        Raises:
            UnusableUploadError: the files or the options cannot be used, too many jobs wait, or the disk is full.
        """
        with self._entry:  # one after another, so that the second click finds the job of the first
            with self._lock:
                asked = [job for job in self._jobs.values() if page and job.page == page and not job.over]
            return asked[0] if asked else self._enter(uploads, options or RoomOptions(), example, page, earlier)

    def _enter(self, uploads: Sequence[Upload], options: RoomOptions, example: bool, page: str, earlier: str) -> Job:
        """As `submit`, for a page without a job."""
        options.check(self.segmenters, self.depths)
        with self._lock:
            waiting = [one for job in self._queue for one in job.uploads]
            full = size_of((*waiting, *uploads)) > self.limits.uploads_bytes and bool(waiting)
            if len(self._queue) >= self.limits.waiting or full:
                rooms = counted(len(self._queue), "room")
                verb = "is" if len(self._queue) == 1 else "are"
                raise UnusableUploadError(f"{rooms} {verb} waiting already. Try again in some minutes.")
        identifier = secrets.token_hex(10)
        folder = self.folder / identifier
        try:
            kind: Any = "example" if example else check_uploads(uploads, self.limits)
            files = _linked(uploads, folder / FILES)
        except FileNotFoundError as error:  # deleted just now
            shutil.rmtree(folder, ignore_errors=True)
            raise UnusableUploadError(GONE) from error
        except OSError as error:
            shutil.rmtree(folder, ignore_errors=True)
            raise UnusableUploadError(
                f"The files cannot be kept: {error.strerror}. Try again in some minutes."
            ) from error
        titles = {
            "photos": counted(len(files), "photo"),
            "clip": "a clip",
            "archive": "a zip",
            "example": "the included room",
        }
        request = Request(kind, files, str(folder), asdict(options), asdict(self.limits))
        sources = tuple(one.path for one in uploads)
        job = Job(identifier, folder, request, titles[kind], sources=sources, page=page, earlier=earlier)
        with self._lock:
            self._jobs[identifier] = job
            self._queue.append(job)
            self._lock.notify_all()
        return job

    def find(self, identifier: str) -> Job | None:
        """The job with an identifier; None if there is none, or its result has expired."""
        with self._lock:
            return self._jobs.get(identifier)

    def ahead(self, job: Job) -> int:
        """How many jobs will be done before a job that waits."""
        with self._lock:
            position = self._queue.index(job) if job in self._queue else 0
            return position + (self._running is not None)

    def cancel(self, job: Job) -> None:
        """Cancel a job; nothing happens if it is over."""
        with self._lock:
            if job.over:
                return
            job.state = "cancelled"
            job.ended = time.time()
            waited = job in self._queue
            if waited:
                self._queue.remove(job)
            process = self._process if self._running is job else None
        if process is not None:
            _stop(process)
        if waited:  # else `_work` cleans it
            _clean(job)

    def start_spare(self) -> None:
        """Start the worker for the next job, unless there is one."""
        with self._lock:
            if self._closed or (self._spare is not None and self._spare.poll() is None):
                return
            if self._spare is not None:
                _close(self._spare)
            temporary = self.folder / TEMPORARY
            shutil.rmtree(temporary, ignore_errors=True)
            temporary.mkdir(exist_ok=True)
            self._spare = subprocess.Popen(
                self._worker,
                stdin=subprocess.PIPE,
                stdout=subprocess.DEVNULL,
                stderr=subprocess.PIPE,
                text=True,
                errors="replace",
                env={**os.environ, "TMPDIR": str(temporary.absolute())},
                start_new_session=True,
            )

    def _work(self) -> None:
        """Take jobs from the queue, until the app closes."""
        while True:
            with suppress(OSError):  # the next job tries again, and says why it is not possible
                self.start_spare()
            with self._lock:
                self._lock.wait_for(lambda: self._queue or self._closed)
                if self._closed:
                    return
                job = self._running = self._queue.popleft()
                job.state, job.started = "working", time.time()
            try:
                self._do(job)
            except Exception:  # a fault of ours must not stop the queue
                self._fail(job, BUG)
                _tell(traceback.format_exc())
            finally:
                with self._lock:
                    self._running = self._process = None
                _clean(job)

    def _do(self, job: Job) -> None:
        """Let a worker do a job; or another, if it ends before it has begun."""
        why = ""
        for _ in range(TRIES):
            try:
                self.start_spare()
            except OSError as error:
                why = str(error)
                continue
            with self._lock:
                if job.over or self._spare is None:  # cancelled, or the app closes
                    return
                process, self._spare = self._spare, None
                self._process = process
            code, log = self._run(job, process)
            if job.over or job.stages:
                return
            why = _how_it_ended(code, log)
        _tell(f"semgs: no worker could be started in {TRIES} tries: {why}")
        self._fail(job, NO_WORKER)

    def _run(self, job: Job, process: subprocess.Popen[str]) -> tuple[int, Sequence[str]]:
        """Let a worker do a job. Returns its exit code, and what it said beside stages."""
        assert process.stdin is not None
        log: deque[str] = deque(maxlen=LOG_LINES)
        reader = threading.Thread(target=_listen, args=(job, process, log), daemon=True)
        stopped = ""
        try:
            reader.start()
            with suppress(BrokenPipeError):
                process.stdin.write(json.dumps(job.request.data()) + "\n")
                process.stdin.close()
            stopped = _watch(process, self.limits, (job.folder / WORK, self.folder / TEMPORARY))
        finally:
            _stop(process)  # with what it started, which would keep its pipe open
        reader.join()
        _close(process)
        code = process.returncode
        with self._lock:
            _end_stage(job)
            if not job.over and code == 0 and (job.room / "room.json").exists():
                job.state, job.ended = "done", time.time()
        if stopped:
            self._fail(job, stopped)
        elif job.refusal:
            self._fail(job, job.refusal)
        elif job.stages and not job.over:
            self._fail(job, KILLED if code == -signal.SIGKILL else BUG)
            _tell(f"semgs: a worker ended with code {code}:", *log)
        return code, log

    def _fail(self, job: Job, sentence: str) -> None:
        """Let a job end with a sentence, unless it is over."""
        with self._lock:
            if not job.over:
                job.state, job.sentence, job.ended = "failed", sentence, time.time()

    def _sweep(self) -> None:
        """Delete results that are too old."""
        while True:
            with self._lock:
                if self._lock.wait_for(lambda: self._closed, SWEEP_SECONDS):
                    return
            self.expire()

    def expire(self) -> None:
        """Delete results and uploads that are too old, and the oldest if all are too large together: uploads first, because results are worth more."""
        now = time.time()
        with self._lock:
            over = sorted((job for job in self._jobs.values() if job.over), key=lambda job: job.ended, reverse=True)
        # Uploads go at the sweep before the time that the page promises, rooms at the one after it.
        ages = {ROOM: self.limits.kept_seconds, FILES: self.limits.uploads_kept_seconds - SWEEP_SECONDS}
        parts = [(job, name) for name in (ROOM, FILES) for job in over]
        together = itertools.accumulate(content_of(job.folder / name)[1] for job, name in parts)
        old = [
            (job, name)
            for (job, name), size in zip(parts, together, strict=True)
            if now - job.ended > (ages[name] if job.state == "done" else FORGOTTEN_SECONDS)
            or (size > self.limits.rooms_bytes and (job is not over[0] or name == FILES))
        ]
        with self._lock:
            for job, name in old:
                if name == ROOM:
                    self._jobs.pop(job.identifier, None)
        for job, name in old:
            shutil.rmtree(job.folder if name == ROOM else job.folder / FILES, ignore_errors=True)
        for path in self.uploads.glob("*"):
            with suppress(OSError):  # gradio and jobs delete uploads at the same time
                if now - path.stat().st_mtime > UPLOAD_SECONDS:
                    if path.is_dir():
                        shutil.rmtree(path)
                    else:  # an upload that a browser has broken off
                        path.unlink()

    def _read_earlier(self) -> None:
        """Take over results of an earlier run of the app; what it did not complete is deleted."""
        for folder in self.folder.iterdir():
            if not IDENTIFIER.fullmatch(folder.name) or not folder.is_dir():
                continue
            shutil.rmtree(folder / FILES, ignore_errors=True)
            record = folder / ROOM / "room.json"
            try:
                title, ended = str(parse_json(record.read_bytes())["title"]), record.stat().st_mtime
            except (OSError, ValueError, KeyError, TypeError):
                shutil.rmtree(folder, ignore_errors=True)
                continue
            request = Request("example", [], str(folder), {})
            job = Job(folder.name, folder, request, title, state="done", started=ended, ended=ended)
            self._jobs[folder.name] = job
        self.expire()


def _watch(process: subprocess.Popen[str], limits: Limits, folders: Sequence[Path]) -> str:
    """Wait for a worker. If it, with what it started, takes too much memory or disk, all of it is killed at once.

    Returns:
        why it has to be stopped; empty if it has ended.
    """
    end, measured = time.monotonic() + limits.seconds, 0.0
    most = min(limits.memory_bytes, (group_bytes(process.pid) or 0.0) + FREE_SHARE * free_bytes())
    while (left := end - time.monotonic()) > 0:
        with suppress(subprocess.TimeoutExpired):
            process.wait(min(WATCH_SECONDS, left))
            return ""
        if (group_bytes(process.pid) or 0.0) > most:
            _kill(process, signal.SIGKILL)
            return TOO_MUCH.format(gb=most / 1e9)
        if time.monotonic() > measured + DISK_SECONDS:
            if sum(content_of(folder)[1] for folder in folders) > limits.disk_bytes:
                _kill(process, signal.SIGKILL)
                return TOO_LARGE.format(gb=limits.disk_bytes / 1e9)
            measured = time.monotonic()
    return LATE.format(minutes=limits.seconds / 60)


def _listen(job: Job, process: subprocess.Popen[str], log: deque[str]) -> None:
    """Take over what a worker reports, and keep what else it says, until it has ended."""
    assert process.stderr is not None
    begins = True
    while line := process.stderr.readline(MOST_LINE):
        if begins and not _note_report(job, line):
            log.append(line.rstrip())
        begins = line.endswith("\n")


def _how_it_ended(code: int, log: Sequence[str]) -> str:
    """How a worker ended that has not begun, on one line."""
    if code == -signal.SIGKILL:
        return "the last one was killed, probably because memory ran out"
    said = next((line for line in reversed(log) if line.strip()), "it said nothing")
    return f"the last one ended with code {code}: {printable(said)}"


def _tell(*lines: str) -> None:
    """Tell whoever runs the app, if there is still a terminal."""
    with suppress(OSError, ValueError):
        print(*[printable(line) for text in lines for line in text.splitlines()], sep="\n", file=sys.stderr, flush=True)


def _note_report(job: Job, line: str) -> bool:
    """Take over a stage that a worker reports, or why it cannot do the job. Returns whether the line is one of these."""
    if not line.startswith("{"):
        return False
    try:
        told = json.loads(line)
        if "refused" in told:
            job.refusal = printable(str(told["refused"]))
            return True
        title, done, of = str(told["stage"]), int(told.get("done", 0)), int(told.get("of", 0))
    except (ValueError, KeyError, TypeError, OverflowError, RecursionError):
        return False
    if job.stages and job.stages[-1].title == title and of:
        job.stages[-1].done, job.stages[-1].of = done, of
        return True
    _end_stage(job)
    job.stages.append(Stage(printable(title), time.time(), None, done, of))
    return True


def _end_stage(job: Job) -> None:
    """Stop the clock of the last stage."""
    if job.stages and job.stages[-1].seconds is None:
        job.stages[-1].seconds = time.time() - job.stages[-1].start


def _clean(job: Job) -> None:
    """Delete the files of a job that is over, except its result and the uploads for another one."""
    shutil.rmtree(job.folder / WORK, ignore_errors=True)
    if job.state != "done":
        shutil.rmtree(job.folder, ignore_errors=True)
        return
    for path in job.sources:
        with suppress(OSError):
            path.unlink(missing_ok=True)
            path.parent.rmdir()  # gradio makes a folder for each file; `files` of an earlier job is empty after the last


def _linked(uploads: Sequence[Upload], folder: Path) -> list[list[str]]:
    """Make uploads available in a new folder, without a copy if both are on one disk. Returns the path and the name of each."""
    folder.mkdir(parents=True)
    files = []
    for number, one in enumerate(uploads):
        target = folder / f"{number:03d}{one.ending}"
        link_or_copy(one.path, target)
        files.append([str(target), one.name])
    return files


def _stop(process: subprocess.Popen[str]) -> None:
    """End a worker and what it started, also if it has ended itself: first with a request, then by force."""
    for number in (signal.SIGTERM, signal.SIGKILL):
        _kill(process, number)
        with suppress(subprocess.TimeoutExpired):
            process.wait(STOP_SECONDS)


def _kill(process: subprocess.Popen[str], number: signal.Signals) -> None:
    """Send a signal to a worker and what it started, if there is still something."""
    with suppress(ProcessLookupError, PermissionError):
        os.killpg(process.pid, number)


def _close(process: subprocess.Popen[str]) -> None:
    """Close the pipes of a worker that has ended."""
    for pipe in (process.stdin, process.stderr):
        if pipe is not None:
            with suppress(OSError):
                pipe.close()
