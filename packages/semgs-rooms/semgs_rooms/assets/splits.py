"""Split meshes and images between training rooms, validation rooms and the held-out style `other`.

Of each class, about 60 % are for training, 20 % for validation rooms and 20 % for the style `other`. Meshes by the same maker look
alike, so they form families, and no family is in both training and `other`. The split depends only on names (through a hash), so it
is the same everywhere.
"""

from __future__ import annotations

import hashlib
import re
from collections import defaultdict
from collections.abc import Sequence
from typing import Literal

from semgs_rooms.assets.catalogue import ImageEntry, MeshEntry

Split = Literal["training", "validation", "other"]

OTHER_SHARE = 0.2
VALIDATION_SHARE = 0.25
"""Share of what is not in `other`."""

GENERATED = "bake"
"""Maker prefix of pieces from `semgs_rooms.furniture`. Everyone generates their own to train on, so none of them is ever in `other`."""
KITS = ("kenney", "qt", "kkf", "kkr", "proc", GENERATED)
"""Makers whose pieces of one class form one family."""

SAME_GENERATOR = {
    "ig_armchair": "ig_sofa", "ig_blinds": "ig_window", "ig_bookcase": "ig_largeshelf", "ig_cabinet": "ig_wardrobe",
    "ig_cellshelf": "ig_largeshelf", "ig_island": "ig_kitchenbase", "ig_kitchenwall": "ig_kitchenbase",
    "ig_sideboard": "ig_dresser",
}  # fmt: skip
"""Families made by the same generator with other settings."""


def family(entry: MeshEntry) -> str:
    """The family of a mesh: maker and class for kits, else the name without numbers and variants."""
    maker = entry.name.split("_")[0]
    if maker in KITS:
        return f"{maker} {entry.label}"
    if maker != "ig":
        return entry.name.rstrip("0123456789_")
    stem = re.sub(r"(_[a-z]?\d*)*$", "", re.sub(r"_n?\d+$", "", entry.name))
    return SAME_GENERATOR.get(stem, stem)


def split_meshes(rows: Sequence[MeshEntry]) -> dict[str, Split]:
    """The split of each mesh, by name. Small classes are decided first, and a family with several classes follows the first."""
    families: dict[str, dict[str, list[str]]] = defaultdict(lambda: defaultdict(list))
    for entry in rows:
        families[entry.label][family(entry)].append(entry.name)
    result: dict[str, Split] = {}
    decided: dict[str, bool] = {}
    for label in sorted(families, key=lambda label: (sum(map(len, families[label].values())), label)):
        groups = families[label]
        wanted = OTHER_SHARE * sum(map(len, groups.values()))
        fixed = sum(len(names) for key, names in groups.items() if decided.get(key))
        decided |= {key: False for key in groups if key.split()[0] == GENERATED}
        open_keys = sorted((key for key in groups if key not in decided), key=_rank)
        held_out = _subset([len(groups[key]) for key in open_keys], wanted - fixed, fixed == 0 and len(groups) > 1)
        decided |= {key: number in held_out for number, key in enumerate(open_keys)}
        rest = sorted((name for key, names in groups.items() if not decided[key] for name in names), key=_rank)
        result |= {name: "other" for key, names in groups.items() if decided[key] for name in names}
        result |= _trained(rest)
    return result


def split_images(rows: Sequence[ImageEntry]) -> dict[str, Split]:
    """The split of each image, by name; a fifth of each kind is held out, chosen by a hash."""
    kinds: dict[str, list[str]] = defaultdict(list)
    for entry in rows:
        kinds[entry.kind].append(entry.name)
    result: dict[str, Split] = {}
    for names in kinds.values():
        ranked = sorted(names, key=_rank)
        held_out = max(1, round(OTHER_SHARE * len(ranked))) if len(ranked) > 1 else 0
        result |= dict.fromkeys(ranked[:held_out], "other")
        result |= _trained(ranked[held_out:])
    return result


def _trained(ranked: list[str]) -> dict[str, Split]:
    """Split names, sorted by their hash, into training and validation."""
    count = round(VALIDATION_SHARE * len(ranked))
    validation: dict[str, Split] = dict.fromkeys(ranked[:count], "validation")
    training: dict[str, Split] = dict.fromkeys(ranked[count:], "training")
    return validation | training


def _rank(name: str) -> str:
    return hashlib.sha256(name.encode()).hexdigest()


def _subset(sizes: list[int], wanted: float, at_least_one: bool) -> set[int]:
    """Indices of the numbers whose sum is closest to the wanted one; of equal choices, the first."""
    ways: dict[int, tuple[int, ...]] = {0: ()}
    for number, size in enumerate(sizes):
        for total, members in list(ways.items()):
            ways.setdefault(total + size, (*members, number))
    if at_least_one and len(ways) > 1:
        del ways[0]
    return set(ways[min(ways, key=lambda total: (abs(total - wanted), total))])
