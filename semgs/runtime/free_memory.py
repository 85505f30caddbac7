"""Free memory for this process, within the limits of the system, of every container around it, and of the process itself.

A container is a Linux control group. Groups are nested, and the one with the least free memory counts. A group's cached file pages are
released before memory runs out, so they count as free.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from pathlib import Path

KIBIBYTE = 1024

ROOT = Path("/")

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
    groups = (_left_in(group) for group in control_groups(root))
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


def control_groups(root: Path = ROOT) -> Iterator[Path]:
    """The folders of the memory groups of this process, from its own to the outermost visible one."""
    for kind, mounted, top in _mounts(root):
        own = _own_group(root, kind)
        if own is None:
            continue
        # Inside a container the path may be the one seen from outside, which does not exist here.
        inside = Path(own).relative_to(mounted) if Path(own).is_relative_to(mounted) else Path()
        folder = top / inside
        while not folder.is_dir() and folder != top:
            folder = folder.parent
        yield folder
        while folder != top:
            folder = folder.parent
            yield folder


def _mounts(root: Path) -> Iterator[tuple[str, str, Path]]:
    """Every mount of memory groups: its type, its top group, and its folder."""
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
    for line in _lines(path):
        name, *rest = line.replace(":", " ").split() or [""]
        if rest and rest[0].isdigit():
            found[name] = float(rest[0])
    return found


def _number(path: Path) -> float:
    """The number in a file; infinite if it is `max`, or if there is no file."""
    lines = _lines(path)
    return float(lines[0]) if lines and lines[0].strip().isdigit() else math.inf


def _lines(path: Path) -> list[str]:
    """The lines of a file; none if it cannot be read."""
    try:
        return path.read_text(encoding="utf-8", errors="replace").splitlines()
    except OSError:
        return []
