"""Runs `semgs batch` in a process of its own, kills it or one of its workers, and compares folders."""

from __future__ import annotations

import os
import re
import signal
import subprocess
import sys
import time
from collections.abc import Sequence
from pathlib import Path

ROOT = Path(__file__).resolve().parents[2]

TIMES = (
    (re.compile(r"records/.*\.json"), rb'"seconds": [\d.]+'),
    (re.compile(r".*/report\.json"), rb'"seconds": \{[^}]*\}'),
    (re.compile(r".*/report\.html"), rb"[\d.]+ m?s<|[\d.]+ min<"),
    (re.compile(r"index\.html"), rb'<td class="number">[\d.]*</td></tr>'),
)
"""Files that say how long something took, and where. These parts are not compared, and neither are the seconds of index.csv."""


def tree(out: Path) -> dict[str, bytes]:
    """Every file in a folder, without the times in it."""
    found = {}
    for path in sorted(out.rglob("*")):
        name = str(path.relative_to(out))
        data = path.read_bytes() if path.is_file() else b""
        for files, pattern in TIMES:
            if files.fullmatch(name):
                data = re.sub(pattern, b"", data)
        if name == "index.csv":
            data = re.sub(rb",[\d.]*(?=,[^,]*,[^,]*,(?:[^,\"]*|\".*\")$)", b"", data, flags=re.MULTILINE)
        found[name] = data
    return found


def start(arguments: Sequence[str]) -> subprocess.Popen:
    """Start `semgs batch` with these arguments."""
    environment = {**os.environ, "PYTHONPATH": os.pathsep.join([str(ROOT), os.environ.get("PYTHONPATH", "")])}
    return subprocess.Popen(
        [sys.executable, "-m", "semgs", "batch", *arguments],
        env=environment, stdout=subprocess.DEVNULL, stderr=subprocess.PIPE, text=True,
    )  # fmt: skip


def workers_of(run: int) -> list[int]:
    """The workers of a run: children of its fork server."""
    parents = {}
    for folder in Path("/proc").glob("[0-9]*"):
        try:
            parents[int(folder.name)] = int((folder / "stat").read_text().rpartition(")")[2].split()[1])
        except OSError:  # it has ended
            continue
    return [process for process, parent in parents.items() if parents.get(parent) == run]


def kill_worker(run: int, number: int) -> bool:
    """Kill a worker; False if there is none."""
    workers = workers_of(run)
    if not workers:
        return False
    os.kill(workers[number % len(workers)], signal.SIGKILL)
    return True


def wait_for_end(processes: Sequence[int], seconds: float = 30) -> None:
    """Wait until processes have ended that are not our children."""
    until = time.monotonic() + seconds
    while any(Path(f"/proc/{process}").exists() for process in processes):
        if time.monotonic() > until:
            raise TimeoutError(f"{processes} are still there")
        time.sleep(0.05)
