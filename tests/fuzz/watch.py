"""What a case may not do: take long, take much memory, write outside its folder, run something, or read what an archive points at."""

from __future__ import annotations

import os
import resource
import signal
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from types import FrameType
from typing import Any

SECONDS = 10.0
"""CPU time of a case [s]."""
WALL_SECONDS = 90.0
"""Time after which a process is ended that native code holds [s]; six other programs may share the machine."""
MEMORY = 1 << 30
"""Memory that a case may take [bytes]."""
SECRET = "outside/secret.png"
"""A file beside the folder of the case, which an archive must not lead to."""

WRITES = os.O_WRONLY | os.O_RDWR | os.O_CREAT | os.O_TRUNC | os.O_APPEND
CHANGES = frozenset(
    {
        "os.remove",
        "os.rename",
        "os.mkdir",
        "os.rmdir",
        "os.symlink",
        "os.link",
        "os.chmod",
        "os.truncate",
        "shutil.rmtree",
    }
)
RUNS = frozenset(
    {"subprocess.Popen", "os.system", "os.exec", "os.posix_spawn", "os.fork", "os.forkpty", "pickle.find_class", "socket.connect", "socket.bind"}
)  # fmt: skip


class TooLong(BaseException):
    """A case took more than `SECONDS`."""


class Watch:
    """Notes what Python's audit events tell while a case runs. There is one in a process, as hooks cannot be removed."""

    def __init__(self, folder: Path) -> None:
        self.folder = str(folder.resolve())
        self.active = False
        self.seen: list[str] = []
        sys.addaudithook(self._event)
        signal.signal(signal.SIGPROF, self._too_long)

    def _event(self, event: str, arguments: tuple[Any, ...]) -> None:
        if not self.active:
            return
        if event == "open":
            path, flags = arguments[0], arguments[2]
            written = isinstance(flags, int) and flags & WRITES
            if isinstance(path, str | bytes) and (written or SECRET in os.fsdecode(path)):
                self._judge("writes" if written else "reads", path)
        elif event in CHANGES:
            self._judge(event, arguments[1 if event in ("os.rename", "os.link", "os.symlink") else 0])
        elif event in RUNS:
            self.seen.append(f"runs {event} {arguments!r:.80}")

    def _judge(self, what: str, path: Any) -> None:
        """Note a path that leads out of the folder; nothing but a secret is forbidden to read."""
        known = isinstance(path, str | bytes | os.PathLike)
        place = os.path.abspath(os.fsdecode(path)) if known else ""  # noqa: PTH100 - raises no audit events of its own
        if what == "reads":
            self.seen.append(f"reads {place}")
        elif place and not (place + "/").startswith(self.folder + "/") and place != os.devnull:
            self.seen.append(f"{what} {place}")

    @staticmethod
    def _too_long(number: int, frame: FrameType | None) -> None:
        raise TooLong

    @contextmanager
    def case(self) -> Iterator[list[str]]:
        """Watch the block.

        Yields:
            What was seen, complete after the block.

        Raises:
            TooLong: it takes more than `SECONDS`.
        """
        self.seen = []
        pages = int(Path("/proc/self/statm").read_text().split()[0])
        soft, hard = resource.getrlimit(resource.RLIMIT_AS)
        resource.setrlimit(resource.RLIMIT_AS, (pages * resource.getpagesize() + MEMORY, hard))
        signal.setitimer(signal.ITIMER_PROF, SECONDS)
        bytecode, sys.dont_write_bytecode = (
            sys.dont_write_bytecode,
            True,
        )  # else Python writes that of what a reader imports
        self.active = True
        try:
            yield self.seen
        finally:
            self.active = False
            sys.dont_write_bytecode = bytecode
            signal.setitimer(signal.ITIMER_PROF, 0)
            resource.setrlimit(resource.RLIMIT_AS, (soft, hard))
