"""Your own class tables: a JSON file with the classes, their colours and their numbers in label images.

    {"name": "five",
     "classes": [{"name": "wall", "colour": [174, 199, 232], "ids": [1]},
                 {"name": "seat", "colour": [188, 189, 34], "ids": [5, 6]}],
     "ignored": [0]}

If no class has `ids`, the numbers are positions in the list, from 0. `ignored` lists the numbers of unlabelled pixels; 255 is always
ignored. Any other number in a label image is an error.

Or it says which of ScanNet's 20 classes each number is; pixels of a class that is none of them (null), or of `unknown`, a number or a list of
them, are unlabelled:

    {"classes": [{"id": 0, "name": "wall", "scannet20": "wall"},
                 {"id": 20, "name": "dresser", "scannet20": "cabinet"},
                 {"id": 23, "name": "ceiling", "scannet20": null}],
     "unknown": 255}

Both may have `terms`: the terms of use of the labels and their images, which weights that learn from them repeat. No torch.
"""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Any

from semgs.data.tables.classes import IGNORE, SCANNET20, ClassTable
from semgs.files.errors import InputError, input_error
from semgs.files.paths import typed_path
from semgs.files.stored import Stored
from semgs.files.strict_json import read_json

LIKE = 'write the file like {"classes": [{"name": "wall", "colour": [174, 199, 232], "ids": [1]}], "ignored": [0]}'
LIKE_SCANNET20 = (
    'write the file like {"classes": [{"id": 20, "name": "dresser", "scannet20": "cabinet"}], "unknown": 255}'
)
"""Advice for files of another form."""


@dataclass(frozen=True)
class LabelSet:
    """A class table and the meaning of the numbers in label images.

    Attributes:
        table: the classes.
        meaning: the label of each number from 0 to 255: 255 for none, None for a number that must not occur.
        terms: the terms of use that the file states; "" if it states none.
    """

    table: ClassTable
    meaning: tuple[int | None, ...]
    terms: str = ""


def read_class_file(path: str | Stored) -> LabelSet:
    """The class table in a file.

    Raises:
        InputError: it is missing, not JSON, or not as described above; the error names the key.
    """
    path = typed_path(path) if isinstance(path, str | Path) else path
    expected = "a table of classes as JSON"
    content = read_json(path, expected)
    if not isinstance(content, dict) or not isinstance(content.get("classes"), list) or not content["classes"]:
        raise InputError(path, 'an object with a list "classes"', "something else", advice=LIKE)
    listed = content["classes"]
    terms = content.get("terms", "")
    if not isinstance(terms, str):
        raise InputError(path, "text", repr(terms), key="terms")
    if any(isinstance(one, dict) and "scannet20" in one for one in listed):
        return LabelSet(SCANNET20, _scannet20_labels(path, content), terms)
    if unknown := sorted(content.keys() - {"name", "classes", "ignored", "terms"}):
        raise InputError(path, "name, classes, ignored, terms", repr(unknown[0]), advice=LIKE)
    numbered = any(isinstance(one, dict) and "ids" in one for one in listed)
    names, colours, ids = [], [], []
    for index, one in enumerate(listed):
        key = f"classes[{index}]"
        if not isinstance(one, dict) or not isinstance(one.get("name"), str) or not one["name"]:
            raise InputError(path, "an object with a name", repr(one), key=key, advice=LIKE)
        if unknown := sorted(one.keys() - {"name", "colour", "ids"}):
            raise InputError(path, "name, colour, ids", repr(unknown[0]), key=key, advice=LIKE)
        colour = one.get("colour", [])
        if not _numbers(colour) or len(colour) != 3:
            raise InputError(path, "[red, green, blue] from 0 to 255", repr(colour), key=f"{key}.colour", advice=LIKE)
        own = one.get("ids", [] if numbered else [index])
        if not _numbers(own) or not own:
            raise InputError(path, "a list of numbers from 0 to 255", repr(own), key=f"{key}.ids", advice=LIKE)
        if IGNORE in own:
            raise _used_for_no_label(path, f"{key}.ids")
        names.append(one["name"])
        colours.append((colour[0], colour[1], colour[2]))
        ids.append(own)
    ignored = content.get("ignored", [])
    if not _numbers(ignored):
        raise InputError(path, "a list of numbers from 0 to 255", repr(ignored), key="ignored")
    meaning: list[int | None] = [None] * 256
    for label, numbers in [*enumerate(ids), (IGNORE, [*ignored, *({IGNORE} - set(ignored))])]:
        for number in numbers:
            if meaning[number] is not None:
                raise InputError(path, "each number once", f"{number} twice", key="classes")
            meaning[number] = label
    with input_error(path, expected, "classes"):
        table = ClassTable(
            str(content.get("name", Path(path.name).stem)), tuple(names), tuple(colours), tuple(own[0] for own in ids)
        )
    return LabelSet(table, tuple(meaning), terms)


def _scannet20_labels(path: Path | Stored, content: dict[str, Any]) -> tuple[int | None, ...]:
    """The label in ScanNet's 20 classes of each number, from a file that states it with `scannet20`."""
    if others := sorted(content.keys() - {"name", "classes", "unknown", "terms"}):
        raise InputError(path, "name, classes, unknown, terms", repr(others[0]))
    stated = content.get("unknown", IGNORE)
    unknown = stated if isinstance(stated, list) else [stated]
    if not _numbers(unknown):
        raise InputError(
            path,
            "a number from 0 to 255" if isinstance(stated, int) else "a whole number, or a list of them",
            f"{stated!r:.60}",
            key="unknown",
        )
    labels = dict.fromkeys((IGNORE, *unknown), IGNORE)
    for index, entry in enumerate(content["classes"]):
        key = f"classes[{index}]"
        if not isinstance(entry, dict) or entry.keys() - {"name"} != {"id", "scannet20"}:
            raise InputError(
                path, "an object with id, scannet20 and a name", repr(entry), key=key, advice=LIKE_SCANNET20
            )
        number, name = entry["id"], entry["scannet20"]
        if not _numbers([number]):
            raise InputError(path, "a number from 0 to 255", repr(number), key=f"{key}.id")
        if number == IGNORE:
            raise _used_for_no_label(path, f"{key}.id")
        if number in labels:
            raise InputError(path, "each number once", f"{number} twice", key=f"{key}.id")
        if name is not None and name not in SCANNET20.names:
            raise InputError(path, "one of ScanNet's 20 classes, or null", repr(name), key=f"{key}.scannet20")
        labels[number] = IGNORE if name is None else SCANNET20.index(name)
    return tuple(labels.get(number) for number in range(256))


def _used_for_no_label(path: Path | Stored, key: str) -> InputError:
    """The error for a class whose number is that of pixels without a label."""
    advice = "write another number into the masks and here"
    return InputError(path, "numbers from 0 to 254", f"{IGNORE}, which always means no label", key, advice)


def class_file(table: ClassTable) -> dict[str, Any]:
    """The content of a class file for labels that are positions in the table."""
    listed = [{"name": name, "colour": list(colour)} for name, colour in zip(table.names, table.colours, strict=True)]
    return {"name": table.name, "classes": listed}


def _numbers(value: Any) -> bool:
    """Whether a value is a list of whole numbers from 0 to 255."""
    return isinstance(value, list) and all(type(one) is int and 0 <= one <= 255 for one in value)
