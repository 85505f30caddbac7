"""The elements of a PLY file as tables of numbers, read without trusting the header, and vertices written.

Format: G. Turk, "The PLY Polygon File Format", 1994. Text, binary little endian and binary big endian are read; elements with lists, as the faces of a mesh are,
are not, but may follow what is read.
"""

from __future__ import annotations

import io
import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import NoReturn

import numpy as np

from semgs.files.atomic import write_bytes
from semgs.files.errors import InputError, input_error
from semgs.files.stored import Stored

MAGIC = b"ply"
EXPECTED = "a PLY file"

LONGEST_HEADER = 1 << 20
"""Bytes in which the header has to end."""

VERTEX = "vertex"
"""The element of points, and of Gaussians."""

LIST = "list"
"""The type of a property that is a list."""

MOST_ELEMENTS = 100
"""Elements of a header; files have a handful."""

MOST_DIGITS = 12
"""Digits of a count."""

ORDERS = {"binary_little_endian": "<", "binary_big_endian": ">", "ascii": ""}

_TYPES = {
    "char": "i1", "uchar": "u1", "short": "i2", "ushort": "u2", "int": "i4", "uint": "u4", "float": "f4", "double": "f8",
    "int8": "i1", "uint8": "u1", "int16": "i2", "uint16": "u2", "int32": "i4", "uint32": "u4", "float32": "f4", "float64": "f8",
}  # fmt: skip

_END = re.compile(rb"(?:^|\n)end_header[ \t]*\r?\n")
_REMARK = re.compile(rb"[ \t]*(?:comment|obj_info)(?:\s|$)")


@dataclass(frozen=True)
class Element:
    """An element as the header describes it.

    Attributes:
        name: such as "vertex".
        count: of rows.
        types: the type of each property, as NumPy writes it without its order of bytes; `LIST` for a list.
    """

    name: str
    count: int
    types: dict[str, str]


@dataclass(frozen=True)
class PlyTables:
    """The content of a file.

    Attributes:
        tables: the columns of each element that was read, by their names.
        counts: the rows of each element, also of those that were not read.
        comments: the lines of comments.
    """

    tables: Mapping[str, Mapping[str, np.ndarray]]
    counts: Mapping[str, int]
    comments: tuple[str, ...]


def read_tables(path: str | Stored, data: bytes, last: str | None = None) -> PlyTables:
    """The tables of a PLY file.

    Args:
        path: the file, for errors.
        data: its bytes.
        last: the last element to read; what follows it is skipped. None reads all, or up to the first one with lists if that follows the vertices.

    Raises:
        InputError: it is not a PLY file, is longer or shorter than its header says, has lists in what has to be read, or lacks the element `last`.
    """
    end = _END.search(data, 0, LONGEST_HEADER)
    if end is None:
        raise InputError(path, EXPECTED, "no end of a header")
    order, elements, comments = _header(path, data[: end.start()])
    names, read = [element.name for element in elements], elements
    if last is not None:
        if last not in names:
            raise InputError(path, f"an element {last}", ", ".join(names) or "none", "header")
        read = elements[: names.index(last) + 1]
    listed = next((place for place, element in enumerate(read) if LIST in element.types.values()), None)
    if listed is not None:
        if last is not None or VERTEX not in names[:listed]:
            _refuse_lists(path, read[listed])
        read = read[:listed]
    complete = last is None and len(read) == len(elements)
    body = memoryview(data)[end.end() :]
    tables = _binary(path, body, order, read, complete) if order else _text(path, bytes(body), read, complete)
    return PlyTables(tables, {element.name: element.count for element in elements}, comments)


def with_plain_header(data: bytes) -> bytes:
    """A PLY file without the comments of its header, for libraries that refuse those that are not UTF-8."""
    end = _END.search(data, 0, LONGEST_HEADER)
    if end is None:
        return data
    lines = data[: end.start()].split(b"\n")
    return b"\n".join(line for line in lines if not _REMARK.match(line)) + data[end.start() :]


def _refuse_lists(path: str | Stored, element: Element) -> NoReturn:
    """Refuse an element for its first list."""
    name = next(name for name, kind in element.types.items() if kind == LIST)
    expected = f"numbers in the element {element.name}"
    advice = "lists can be read only after the vertices, so save the file without it"
    raise InputError(path, expected, f"the list property {name}, which cannot be read", "header", advice)


def _header(path: str | Stored, text: bytes) -> tuple[str, list[Element], tuple[str, ...]]:
    """The order of bytes ("" for text), the elements and the comments of a header."""
    with input_error(path, EXPECTED, "header"):
        lines = [_line(line) for line in text.split(b"\n")]
    if lines[0] != "ply":
        raise InputError(path, EXPECTED, "another first line than ply", "header")
    order: str | None = None
    elements: list[Element] = []
    comments: list[str] = []
    for number, line in enumerate(lines[1:], 2):
        words = line.split()
        place = f"line {number}"
        match words:
            case []:
                pass
            case ["comment" | "obj_info", *_]:
                comments.append(line.partition(" ")[2])
            case ["format", name, "1.0"] if name in ORDERS and order is None:
                order = ORDERS[name]
            case ["element", name, count] if count.isascii() and count.isdigit() and len(count) <= MOST_DIGITS:
                if len(elements) == MOST_ELEMENTS or any(element.name == name for element in elements):
                    raise InputError(
                        path, f"at most {MOST_ELEMENTS} elements with different names", f"{name:.60} as well", place
                    )
                elements.append(Element(name, int(count), {}))
            case ["property", "list", _, _, name] if elements:
                _add(path, place, elements[-1], name, LIST)
            case ["property", kind, name] if elements and kind in _TYPES:
                _add(path, place, elements[-1], name, _TYPES[kind])
            case _:
                raise InputError(path, "a line of a PLY header", f"{line[:60]!r}", place)
    if order is None:
        raise InputError(path, "a line with the format", "none", "header")
    return order, elements, tuple(comments)


def _line(line: bytes) -> str:
    """A line of a header. Comments are in the encoding of whoever wrote them: bytes that are not UTF-8 are replaced."""
    return line.decode("utf-8", "replace" if _REMARK.match(line) else "strict").rstrip("\r")


def _add(path: str | Stored, place: str, element: Element, name: str, kind: str) -> None:
    """Add a property to an element."""
    if name in element.types:
        raise InputError(path, "properties with different names", f"{name} twice", place)
    element.types[name] = kind


def _binary(
    path: str | Stored, body: memoryview, order: str, elements: list[Element], complete: bool
) -> dict[str, dict[str, np.ndarray]]:
    """The tables of a binary body, without copies; `complete` if nothing may follow them."""
    kinds = [
        np.dtype({"names": list(element.types), "formats": [order + kind for kind in element.types.values()]})
        for element in elements
    ]
    length = sum(element.count * kind.itemsize for element, kind in zip(elements, kinds, strict=True))
    if length > len(body) or (complete and length < len(body)):
        raise InputError(path, f"{length:,} bytes after the header, as it says", f"{len(body):,}")
    tables, start = {}, 0
    for element, kind in zip(elements, kinds, strict=True):
        rows = np.frombuffer(body, kind, element.count, start) if kind.itemsize else np.empty(0, kind)
        start += rows.nbytes
        tables[element.name] = {name: rows[name] for name in element.types}
    return tables


def _text(path: str | Stored, body: bytes, elements: list[Element], complete: bool) -> dict[str, dict[str, np.ndarray]]:
    """The tables of a body of text: a line for each row; `complete` if nothing may follow them."""
    lines = [line for line in body.split(b"\n") if line.strip()]
    total = sum(element.count for element in elements)
    if len(lines) < total or (complete and len(lines) > total):
        raise InputError(path, f"{total:,} lines after the header, as it says", f"{len(lines):,}")
    tables, start = {}, 0
    for element in elements:
        part = lines[start : start + element.count]
        start += element.count
        if not part or not element.types:
            tables[element.name] = {name: np.empty(0) for name in element.types}
            continue
        with input_error(path, f"{len(element.types)} numbers in each line", f"element {element.name}"):
            rows = np.loadtxt(io.BytesIO(b"\n".join(part)), np.float64, comments=None, ndmin=2, encoding="ascii")
        if rows.shape != (element.count, len(element.types)):
            found = f"{rows.shape[-1]}"
            raise InputError(path, f"{len(element.types)} numbers in each line", found, f"element {element.name}")
        tables[element.name] = {
            name: _as_type(path, element.name, name, rows[:, column], kind)
            for column, (name, kind) in enumerate(element.types.items())
        }
    return tables


def _as_type(path: str | Stored, element: str, name: str, values: np.ndarray, kind: str) -> np.ndarray:
    """Numbers from a text in the type that the header gives them."""
    if kind[0] == "f":
        return values
    limits = np.iinfo(kind)
    good = (values >= limits.min) & (values <= limits.max) & (values == np.floor(values))
    if not good.all():
        found = f"{values[~good][0]:g}"
        raise InputError(path, f"whole numbers from {limits.min} to {limits.max}", found, f"{name} of {element}")
    return values.astype(kind)


def packed(columns: Mapping[str, np.ndarray]) -> np.ndarray:
    """Columns [n] side by side in rows without gaps: uint8 as it is, all other numbers as float32."""
    kinds = [(name, "u1" if values.dtype == np.uint8 else "<f4") for name, values in columns.items()]
    rows = np.empty(len(next(iter(columns.values()))), kinds)
    for name, values in columns.items():
        rows[name] = values
    return rows


def write_ply(
    path: str | Path,
    columns: Mapping[str, np.ndarray],
    comments: Sequence[str] = (),
    *,
    faces: np.ndarray | None = None,
    text: bool = False,
) -> None:
    """Write a PLY, binary little endian or text.

    Args:
        path: the file.
        columns: the properties [n] of the vertices by name: uint8 as `uchar`, all others as `float`.
        comments: lines of the header; line ends in them become spaces.
        faces: [m 3] vertices of triangles; only in binary files.
        text: whether numbers are written as text, with 9 digits.

    Raises:
        OSError: it cannot be written.
    """
    rows = packed(columns)
    types = {name: "uchar" if values.dtype == np.uint8 else "float" for name, values in columns.items()}
    header = ["ply", f"format {'ascii' if text else 'binary_little_endian'} 1.0"]
    header += [f"comment {' '.join(line.splitlines())}" for line in comments]
    header += [f"element vertex {len(rows)}", *(f"property {kind} {name}" for name, kind in types.items())]
    body = rows.tobytes()
    if text:
        table = np.column_stack(list(columns.values())).tolist()
        body = "".join(" ".join(f"{value:.9g}" for value in row) + "\n" for row in table).encode()
    if faces is not None:
        header += [f"element face {len(faces)}", "property list uchar int vertex_indices"]
        triangles = np.empty(len(faces), [("count", "u1"), ("corners", "<i4", 3)])
        triangles["count"], triangles["corners"] = 3, faces
        body += triangles.tobytes()
    write_bytes(path, "\n".join([*header, "end_header", ""]).encode() + body)
