"""Groups of classes that are hard to tell apart, to score names apart from recognition: a desk that is called a table is no wall."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from importlib.resources import files
from pathlib import Path
from typing import final

import numpy as np
from jaxtyping import Int64

from semgs.files.errors import InputError
from semgs.files.strict_json import parse_json, read_json

INCLUDED = ("alike", "coarse13")
"""Groups that ship: three pairs of names that even people mix up, and 13 groups of ScanNet's 20 classes; their files give the reasons."""

FORM = '{"name": "...", "groups": {"table": ["table", "desk"], ...}}'


@final
@dataclass(frozen=True)
class ClassGroups:
    """Groups of the classes of a table.

    Attributes:
        name: of the grouping.
        of: the group of each class, from 0 in the order of the first class of each.
        names: of the groups; a class in none is its own group.
    """

    name: str
    of: tuple[int, ...]
    names: tuple[str, ...]

    def merged(self, counts: Int64[np.ndarray, "*class"]) -> Int64[np.ndarray, "*group"]:
        """Counts of pixels by class, along every axis, as counts by group."""
        member = (np.array(self.of)[:, None] == np.arange(len(self.names))).astype(np.int64)
        for axis in range(counts.ndim):
            counts = np.moveaxis(np.tensordot(member, counts, (0, axis)), 0, axis)
        return counts


def class_groups(source: str, classes: Sequence[str]) -> ClassGroups:
    """Groups of classes from a file, or included ones.

    Args:
        source: one of `INCLUDED`, or a JSON file of the form `FORM`.
        classes: the names of a table, in its order; a group may name others.

    Raises:
        InputError: the file has another form, a class is in two groups, or none of its classes is in the table.
    """
    if source in INCLUDED:
        path = Path(f"{source}.json")
        content = parse_json(files("semgs.data.tables").joinpath(f"groups/{source}.json").read_bytes())
    else:
        path = Path(source)
        content = read_json(path, f"groups of classes: {' or '.join(INCLUDED)}, or a file {FORM}")
    groups = content.get("groups") if isinstance(content, dict) else None
    if not isinstance(groups, dict) or not all(isinstance(one, list) for one in groups.values()):
        raise InputError(path, f"groups of classes as {FORM}", "something else", key="groups")
    group_of: dict[str, str] = {}
    for group, members in groups.items():
        for member in members:
            if not isinstance(member, str):
                raise InputError(path, "names of classes", f"{member!r}", key=f"groups.{group}")
            if member in group_of:
                raise InputError(path, f"{member} in one group", f"in {group_of[member]} and {group}", key="groups")
            group_of[member] = group
    if not set(group_of) & set(classes):
        found = ", ".join(list(group_of)[:5]) or "none"
        raise InputError(path, f"some of the classes {', '.join(classes[:5])}, ...", found, key="groups")
    named = [group_of.get(name, name) for name in classes]
    names = tuple(dict.fromkeys(named))
    return ClassGroups(str(content.get("name", path.stem)), tuple(map(names.index, named)), names)
