"""Memory of this machine: how much is left to this process, by the system, by every container around it, and by its own limits.

A container is a Linux control group. Groups lie in each other, and the one with the least left counts. What a group holds
of files that can be read again is given back before anybody runs out, so it counts as free.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from pathlib import Path

KIBIBYTE = 1024

ROOT = Path("/")

LIMITS = ("memory.max", "memory.high", "memory.limit_in_bytes")
"""Files that hold the most that a group may have: of version 2, and of version 1."""

USES = ("memory.current", "memory.usage_in_bytes")
"""Files that hold what it has."""

RECLAIMABLE = ("total_inactive_file", "inactive_file")
"""Lines of `memory.stat` about files read long ago: the first, of version 1, counts the groups inside too."""


def free_bytes(root: Path = ROOT) -> float:
    """What this process may still take; infinite where nothing says.

    Args:
        root: the folder that holds `proc`; control groups are looked for below it too.
    """
    groups = (_left_in(group) for group in control_groups(root))
    return max(0.0, min((_available(root), _address_space_left(root), *groups), default=math.inf))


def held_bytes(root: Path = ROOT) -> float:
    """What this process has now; 0 where nothing says."""
    return KIBIBYTE * _numbers(root / "proc/self/status").get("VmRSS", 0.0)


def control_groups(root: Path = ROOT) -> Iterator[Path]:
    """The folders of the memory groups that this process is in, from its own to the outermost that can be seen."""
    for kind, mounted, top in _mounts(root):
        own = _own_group(root, kind)
        if own is None:
            continue
        # Inside a container the path may be told as seen from outside, where nothing of that name is to be seen.
        inside = Path(own).relative_to(mounted) if Path(own).is_relative_to(mounted) else Path()
        folder = top / inside
        while not folder.is_dir() and folder != top:
            folder = folder.parent
        yield folder
        while folder != top:
            folder = folder.parent
            yield folder


def _mounts(root: Path) -> Iterator[tuple[str, str, Path]]:
    """Every mount of memory groups: its type, the group that it shows as its top, and where that is."""
    for line in _lines(root / "proc/self/mountinfo"):
        before, _, after = line.partition(" - ")
        fields, (kind, *rest) = before.split(), after.split() or [""]
        of_memory = kind == "cgroup2" or (kind == "cgroup" and "memory" in rest[-1].split(","))
        if of_memory and len(fields) > 4:
            yield kind, fields[3], root / fields[4].lstrip("/")


def _own_group(root: Path, kind: str) -> str | None:
    """The path of this process's memory group."""
    for line in _lines(root / "proc/self/cgroup"):
        _, controllers, path = (*line.split(":", 2), "", "")[:3]
        if (controllers == "") if kind == "cgroup2" else ("memory" in controllers.split(",")):
            return path
    return None


def _left_in(group: Path) -> float:
    """What a group may still take."""
    limit = min((_number(group / name) for name in LIMITS), default=math.inf)
    used = [number for name in USES if math.isfinite(number := _number(group / name))]
    if not math.isfinite(limit) or not used:
        return math.inf
    known = _numbers(group / "memory.stat")
    return limit - used[0] + next((known[name] for name in RECLAIMABLE if name in known), 0.0)


def _available(root: Path) -> float:
    """What the system can give without swapping."""
    return KIBIBYTE * _numbers(root / "proc/meminfo").get("MemAvailable", math.inf)


def _address_space_left(root: Path) -> float:
    """What a limit on the address space (`ulimit -v`) leaves."""
    try:
        import resource
    except ImportError:  # Windows has no such limit
        return math.inf
    limit, _ = resource.getrlimit(resource.RLIMIT_AS)
    if limit == resource.RLIM_INFINITY:
        return math.inf
    return limit - KIBIBYTE * _numbers(root / "proc/self/status").get("VmSize", 0.0)


def _numbers(path: Path) -> dict[str, float]:
    """The lines of a file that are a name and a number."""
    found = {}
    for line in _lines(path):
        name, *rest = line.replace(":", " ").split() or [""]
        if rest and rest[0].isdigit():
            found[name] = float(rest[0])
    return found


def _number(path: Path) -> float:
    """The number that is all of a file; infinite where it is `max`, or where there is no such file."""
    lines = _lines(path)
    return float(lines[0]) if lines and lines[0].strip().isdigit() else math.inf


def _lines(path: Path) -> list[str]:
    """The lines of a file; none where it cannot be read."""
    try:
        return path.read_text(encoding="utf-8", errors="replace").splitlines()
    except OSError:
        return []
