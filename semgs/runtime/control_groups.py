"""The containers around this process: Linux control groups of version 1 and 2, which are nested."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

ROOT = Path("/")


def control_groups(controller: str, root: Path = ROOT) -> Iterator[Path]:
    """The folders of the groups of this process, from its own to the outermost visible one.

    Args:
        controller: what they limit: "memory" or "cpu". Version 2 has the same groups for all.
        root: the folder with `proc` and the control groups.
    """
    for kind, mounted, top in _mounts(controller, root):
        own = _own_group(controller, root, kind)
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


def _mounts(controller: str, root: Path) -> Iterator[tuple[str, str, Path]]:
    """Every mount of such groups: its type, its top group, and its folder."""
    for line in file_lines(root / "proc/self/mountinfo"):
        before, _, after = line.partition(" - ")
        fields, (kind, *rest) = before.split(), after.split() or [""]
        limits = kind == "cgroup2" or (kind == "cgroup" and controller in rest[-1].split(","))
        if limits and len(fields) > 4:
            yield kind, fields[3], root / fields[4].lstrip("/")


def _own_group(controller: str, root: Path, kind: str) -> str | None:
    """The path of this process's group."""
    for line in file_lines(root / "proc/self/cgroup"):
        _, controllers, path = (*line.split(":", 2), "", "")[:3]
        if (controllers == "") if kind == "cgroup2" else (controller in controllers.split(",")):
            return path
    return None


def file_lines(path: Path) -> list[str]:
    """The lines of a file of the system; none if it cannot be read."""
    try:
        return path.read_text(encoding="utf-8", errors="replace").splitlines()
    except OSError:
        return []
