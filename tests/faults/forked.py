"""Commands in forked processes, which need no second import of torch, and the moments at which they change files."""

from __future__ import annotations

import contextlib
import os
import resource
import signal
import sys
import traceback
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass
from importlib import import_module
from pathlib import Path
from typing import Any

WARM = {
    "train": (
        "semgs.training.loop", "semgs.cli.commands.networks.train", "semgs.run.reconstruct", "torch.utils.tensorboard",
    ),
    "reconstruct": (
        "semgs.run.reconstruct",
        "semgs.run.output.files", "semgs.run.steps.pipeline", "semgs.export.ply", "semgs.scene.scene_file",
        "semgs.rendering.render", "semgs.model.weights.load",
    ),
    "rooms": ("semgs_rooms.rooms_command", "semgs_rooms.sets.dataset"),
    "prepare": ("semgs.run.prepare", "semgs.data.preparation.prepared_set"),
    "export": (
        "semgs.run.export", "semgs.scene.scene_file", "semgs.export.ply", "semgs.export.points", "semgs.export.gltf", "semgs.export.colmap"),
}  # fmt: skip
"""Imported before the first fork, for each command. None computes anything, so children start threads of their own."""


def warm(names: Iterable[str]) -> None:
    """Import what some commands and all cases need."""
    own = ("semgs.cli.main", "semgs_rooms.sets.room_scenes", "semgs.scene.scene_file", "semgs.training.run.checkpoints")
    for name in names:
        for module in (*own, *WARM[name]):
            import_module(module)


@dataclass(frozen=True)
class Ended:
    """How a process ended.

    Attributes:
        code: its exit code, or minus the signal that ended it.
        output: what it wrote to stdout and stderr.
        cpu_seconds: CPU time.
    """

    code: int
    output: str
    cpu_seconds: float


def start(work: Callable[[], int], log: Path) -> int:
    """Fork; the child does the work with its output in a file, and exits with what it returns. Returns its number."""
    sys.stdout.flush()
    sys.stderr.flush()
    child = os.fork()
    if child:
        return child
    code = 1
    try:
        file = os.open(log, os.O_WRONLY | os.O_CREAT | os.O_TRUNC)
        os.dup2(file, 1)
        os.dup2(file, 2)
        resource.setrlimit(resource.RLIMIT_CORE, (0, 0))
        code = work()
    except BaseException:
        traceback.print_exc()
    finally:
        with contextlib.suppress(Exception):
            sys.stdout.flush()
            sys.stderr.flush()
        os._exit(code)


def end(child: int, log: Path) -> Ended:
    """Wait for a process."""
    _, status, used = os.wait4(child, 0)
    output = log.read_text(errors="replace") if log.exists() else ""
    return Ended(os.waitstatus_to_exitcode(status), output, used.ru_utime + used.ru_stime)


def run(work: Callable[[], int], log: Path) -> Ended:
    """Do some work in a forked process."""
    return end(start(work, log), log)


def command(arguments: Sequence[str]) -> Callable[[], int]:
    """A command of SemGS as work."""

    def work() -> int:
        from semgs.cli.main import main

        return main(list(arguments))

    return work


BEFORE, CUT, WHOLE = "before a change", "after some bytes", "before the rename"
STAGES = (BEFORE, CUT, WHOLE)
"""When a process is killed: before any change of files, while a file is written, or while it is complete under its temporary name."""


class Moments:
    """Counts the changes that this process makes below a folder, from Python's audit events, and kills it at one of them.

    Args:
        folder: where changes count.
        stage, number: kill this process at that one of the stage's changes; None only counts.
        size: bytes after which a file is cut.
    """

    def __init__(self, folder: Path, stage: str | None = None, number: int = -1, size: int = 0) -> None:
        self._folder, self._stage, self._number, self._size = str(folder), stage, number, size
        self.counts = dict.fromkeys(STAGES, 0)
        self._cutting = False
        # The kernel ends the process in the middle of a write; Python would make an exception of it.
        signal.signal(signal.SIGXFSZ, signal.SIG_DFL)
        sys.addaudithook(self._hook)

    def _hook(self, event: str, arguments: tuple[Any, ...]) -> None:
        if event == "open":
            path, _, flags = arguments
            if isinstance(path, str | bytes | os.PathLike) and flags & (os.O_WRONLY | os.O_RDWR):
                self._met(BEFORE, path)
                if self._met(CUT, path):
                    self._cut(path)
        elif event == "os.rename":
            self._met(BEFORE, arguments[0])
            self._met(WHOLE, arguments[0])
        elif event in ("os.mkdir", "os.remove", "os.rmdir"):
            self._met(BEFORE, arguments[0])
        elif event == "ctypes.dlsym" and arguments[1] == "renameat2":
            self._met(WHOLE, self._folder)

    def _met(self, stage: str, path: object) -> bool:
        """Count a moment; whether it is the one to cut a file at. At the one to kill at, nothing returns."""
        if not os.fsdecode(path).startswith(self._folder):  # type: ignore[arg-type]
            return False
        if self._cutting and stage == WHOLE:
            os.kill(os.getpid(), signal.SIGKILL)  # the file was shorter than where to cut it
        now = self.counts[stage]
        self.counts[stage] += 1
        if stage != self._stage or now != self._number:
            return False
        if stage != CUT:
            os.kill(os.getpid(), signal.SIGKILL)
        return True

    def _cut(self, path: object) -> None:
        """Let the kernel end this process once the file is `size` bytes longer."""
        self._cutting = True
        try:
            there = os.stat(os.fsdecode(path)).st_size  # type: ignore[arg-type] # noqa: PTH116 - a path of any type
        except OSError:
            there = 0
        _, hard = resource.getrlimit(resource.RLIMIT_FSIZE)
        resource.setrlimit(resource.RLIMIT_FSIZE, (there + self._size, hard))
