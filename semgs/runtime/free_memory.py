"""Free memory for this process, within the limits of the system, of every container around it, and of the process itself.

Containers are nested, and the one with the least free memory counts. A container's cached file pages are released before memory runs out, so they count as
free.
"""

from __future__ import annotations

import math
from pathlib import Path

from semgs.runtime.control_groups import ROOT, control_groups, file_lines

KIBIBYTE = 1024

LIMITS = ("memory.max", "memory.high", "memory.limit_in_bytes")
"""Files with a group's memory limit: of version 2, and of version 1."""

USES = ("memory.current", "memory.usage_in_bytes")
"""Files with a group's memory use."""

RECLAIMABLE = ("total_inactive_file", "inactive_file")
"""Lines of `memory.stat` with cached file pages not used lately; the first, of version 1, includes nested groups."""


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
