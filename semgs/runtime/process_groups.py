"""Memory of a process and of what it started, seen from outside."""

from __future__ import annotations

import os
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path

from semgs.runtime.control_groups import ROOT
from semgs.runtime.free_memory import KIBIBYTE


def group_bytes(group: int, root: Path = ROOT) -> float | None:
    """Resident memory of all processes of a group; None if the system does not say.

    Pages that they share count once, where Linux counts shares. That takes longer, so it is only done for groups of several processes.

    Args:
        group: the number of the group, which is that of the process that leads it.
        root: the folder with `proc`.
    """
    if not (root / "proc/self/stat").exists():
        return None if sys.platform == "win32" else _listed_bytes(group)
    members = list(_members(group, root / "proc"))
    if len(members) == 1:
        return _resident_bytes(members[0])
    return sum(_share_bytes(one) for one in members)


def _members(group: int, processes: Path) -> Iterator[Path]:
    """The folders of a group's processes."""
    with os.scandir(processes) as entries:
        names = [entry.name for entry in entries if entry.name.isdigit()]
    for name in names:
        # The name of the program is in brackets and may have any letters; then come the state, the parent and the group.
        fields = _text(processes / name / "stat").rpartition(")")[2].split()
        if len(fields) > 2 and fields[2] == str(group):
            yield processes / name


def _resident_bytes(process: Path) -> float:
    """Resident memory of a process; 0 if it has ended."""
    fields = _text(process / "statm").split()
    return float(fields[1]) * os.sysconf("SC_PAGE_SIZE") if len(fields) > 1 else 0.0


def _share_bytes(process: Path) -> float:
    """Resident memory of a process, with its share of the pages that others have too."""
    for line in _text(process / "smaps_rollup").splitlines():
        if line.startswith("Pss:"):
            return KIBIBYTE * float(line.split()[1])
    return _resident_bytes(process)


def _text(path: Path) -> str:
    """The content of a file of the system; empty if it is gone."""
    try:
        return path.read_text(encoding="utf-8", errors="replace")
    except OSError:
        return ""


def _listed_bytes(group: int) -> float | None:
    """Resident memory of a group as `ps` lists it, on systems without `proc`."""
    try:
        listed = subprocess.run(["ps", "-A", "-o", "pgid=,rss="], capture_output=True, text=True, timeout=5, check=True)
    except (OSError, subprocess.SubprocessError):
        return None
    rows = [line.split() for line in listed.stdout.splitlines()]
    return KIBIBYTE * float(sum(int(row[1]) for row in rows if len(row) == 2 and row[0] == str(group)))
