"""Memory: what is free for this process, within the limits of the system, of every container around it, and of the process itself; and what processes take.

Containers are nested, and the one with the least free memory counts. A container's cached file pages are released before memory runs out, so they count as
free.

The allocator of the C library may keep freed memory for reuse. Every frame and every training step allocates and frees the same hundreds of megabytes. By
default, the GNU C library returns them to the system, which later hands them out again page by page, zeroed. That takes a tenth of the time of a frame.
"""

from __future__ import annotations

import ctypes
import math
import os
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path
from typing import Any, ClassVar

from semgs.runtime.control_groups import ROOT, control_groups, file_lines

KIBIBYTE = 1024

LIMITS = ("memory.max", "memory.high", "memory.limit_in_bytes")
"""Files with a group's memory limit: of version 2, and of version 1."""

USES = ("memory.current", "memory.usage_in_bytes")
"""Files with a group's memory use."""

RECLAIMABLE = ("total_inactive_file", "inactive_file")
"""Lines of `memory.stat` with cached file pages not used lately; the first, of version 1, includes nested groups."""

TRIM_THRESHOLD, MMAP_THRESHOLD = -1, -3
"""Numbers of the two parameters in `malloc.h`."""

NEVER = 2**31 - 1
"""The largest value for the first parameter [bytes]."""

LARGE = 32 * 2**20
"""Blocks of this size and more are taken from the system and returned to it if no kept memory fits, so they leave no holes [bytes].
This is also the largest threshold that the library reaches by itself, but not if another parameter was set."""


class MallocInfo(ctypes.Structure):
    """The GNU C library's `struct mallinfo2`, of which `fordblks` counts the bytes in free blocks."""

    _fields_: ClassVar = [
        (name, ctypes.c_size_t)
        for name in (
            "arena", "ordblks", "smblks", "hblks", "hblkhd", "usmblks", "fsmblks", "uordblks", "fordblks", "keepcost"
        )
    ]  # fmt: skip


def free_bytes(root: Path = ROOT) -> float:
    """Memory that this process may still take; infinite if unknown.

    Args:
        root: the folder with `proc` and the control groups.
    """
    groups = (_left_in(group) for group in control_groups("memory", root))
    return max(0.0, min((_available(root), _address_space_left(root), *groups), default=math.inf))


def held_bytes(root: Path = ROOT) -> float:
    """Memory that this process uses now; 0 if unknown."""
    return process_bytes("VmRSS", root) or 0.0


def kept_bytes() -> float:
    """Freed memory that this process keeps for reuse (`keep_freed_memory`); 0 if unknown."""
    told = _c_function("mallinfo2")
    if told is None:
        return 0.0
    told.restype = MallocInfo
    return float(told().fordblks)


def process_bytes(name: str, root: Path = ROOT) -> float | None:
    """Memory of this process as Linux counts it; None if the system does not say.

    Args:
        name: of a line of `/proc/self/status`: `VmRSS` in use now, `VmHWM` the most since its start, `RssFile` pages of libraries and other
            files, `VmSize` address space.
        root: the folder with `proc`.
    """
    kibibytes = _numbers(root / "proc/self/status").get(name)
    return None if kibibytes is None else KIBIBYTE * kibibytes


def _left_in(group: Path) -> float:
    """Memory that a group may still take."""
    limit = min((_number(group / name) for name in LIMITS), default=math.inf)
    used = [number for name in USES if math.isfinite(number := _number(group / name))]
    if not math.isfinite(limit) or not used:
        return math.inf
    known = _numbers(group / "memory.stat")
    return limit - used[0] + next((known[name] for name in RECLAIMABLE if name in known), 0.0)


def _available(root: Path) -> float:
    """Memory that is available without swapping."""
    return KIBIBYTE * _numbers(root / "proc/meminfo").get("MemAvailable", math.inf)


def _address_space_left(root: Path) -> float:
    """Memory left by a limit on the address space (`ulimit -v`)."""
    try:
        import resource
    except ImportError:  # Windows has no such limit
        return math.inf
    limit, _ = resource.getrlimit(resource.RLIMIT_AS)
    if limit == resource.RLIM_INFINITY:
        return math.inf
    return limit - (process_bytes("VmSize", root) or 0.0)


def _numbers(path: Path) -> dict[str, float]:
    """The lines of a file with a name and a number."""
    found = {}
    for line in file_lines(path):
        name, *rest = line.replace(":", " ").split() or [""]
        if rest and rest[0].isdigit():
            found[name] = float(rest[0])
    return found


def _number(path: Path) -> float:
    """The number in a file; infinite if it is `max`, or if there is no file."""
    lines = file_lines(path)
    return float(lines[0]) if lines and lines[0].strip().isdigit() else math.inf


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


def keep_freed_memory() -> bool:
    """Let this process keep the memory of freed blocks under `LARGE`. Returns whether the C library supports this.

    It affects the whole process, so programs call it, not imports: the command `semgs` does when it starts. Freed memory
    counts as used until the process ends, up to the peak.
    """
    set_parameter = _c_function("mallopt")
    if set_parameter is None:
        return False
    return bool(set_parameter(MMAP_THRESHOLD, LARGE) and set_parameter(TRIM_THRESHOLD, NEVER))


def _c_function(name: str) -> Any:
    """A function of the C library; None in other and older C libraries, and on Windows."""
    try:
        return getattr(ctypes.CDLL(None), name)
    except (AttributeError, OSError, TypeError):
        return None
