"""Containers of glTF 2.0, .glb and .gltf: their JSON, and accessors as arrays, read without trusting any number in them; and .glb files written.

Source: https://registry.khronos.org/glTF/specs/2.0/glTF-2.0.html, chapters 3.6 (buffers, accessors) and 4 (GLB).
"""

from __future__ import annotations

import base64
import binascii
import json
import struct
from dataclasses import dataclass, field
from pathlib import Path, PurePosixPath
from typing import Any
from urllib.parse import unquote

import numpy as np

from semgs.files.atomic import write_bytes
from semgs.files.contents import read_bytes
from semgs.files.errors import InputError, input_error
from semgs.files.strict_json import parse_json

MAGIC = b"glTF"
HEADER, CHUNK = struct.Struct("<4sII"), struct.Struct("<I4s")
VERSION = 2
EXPECTED = "a glTF file"
DATA = "data:"

VERTICES, INDICES = 34962, 34963
"""The targets of buffer views."""

_TYPES = {"SCALAR": 1, "VEC2": 2, "VEC3": 3, "VEC4": 4}
_COMPONENTS = {
    number: np.dtype(kind)
    for number, kind in ((5120, "<i1"), (5121, "<u1"), (5122, "<i2"), (5123, "<u2"), (5125, "<u4"), (5126, "<f4"))
}
_STRIDES = range(4, 253, 4)


@dataclass(frozen=True)
class Container:
    """A file taken apart.

    Attributes:
        path: the file.
        content: its JSON object.
        body: the binary chunk of a .glb; None if it has none.
        read: the buffers that were read, by their number.
        indices: the number of the first buffer from each place.
    """

    path: Path
    content: dict[str, Any]
    body: bytes | None = None
    read: dict[int, bytes] = field(default_factory=dict)
    indices: dict[str, int] = field(default_factory=dict)

    def entry(self, kind: str, index: object, place: str) -> dict[str, Any]:
        """An object of a list of the file, such as "accessors".

        Args:
            kind: the list.
            index: of the object.
            place: what refers to it, for the error.

        Raises:
            InputError: there is none.
        """
        entries = self.content.get(kind, [])
        known = isinstance(entries, list) and type(index) is int and 0 <= index < len(entries)
        if not known or not isinstance(entries[index], dict):
            raise InputError(self.path, f"an object of {kind}", f"{index!r:.40}", place)
        return entries[index]

    def whole(self, entry: dict[str, Any], key: str, place: str, default: int | None = None) -> int:
        """A whole number, 0 or more.

        Raises:
            InputError: it is something else, or is missing and there is no default.
        """
        value = entry.get(key, default)
        if type(value) is not int or value < 0:
            raise InputError(self.path, "a whole number", f"{value!r:.40}", f"{place}.{key}")
        return value

    def count(self, index: object, place: str) -> int:
        """The rows of an accessor."""
        return self.whole(self.entry("accessors", index, place), "count", f"accessors[{index}]")

    def array(self, index: object, place: str) -> np.ndarray:
        """The values of an accessor [n k], as float64; normalised integers as what they stand for.

        Raises:
            InputError: it is sparse, or does not fit its buffer, or has a type that is not known.
        """
        accessor = self.entry("accessors", index, place)
        place = f"accessors[{index}]"
        if "sparse" in accessor:
            raise InputError(self.path, "accessors that are not sparse", "a sparse one", place)
        kinds = accessor.get("type"), accessor.get("componentType")
        width = _TYPES.get(kinds[0]) if isinstance(kinds[0], str) else None
        component = _COMPONENTS.get(kinds[1]) if type(kinds[1]) is int else None
        if width is None or component is None:
            found = f"{kinds[0]!r:.20}, {kinds[1]!r:.20}"
            raise InputError(self.path, "scalars or vectors of a known componentType", found, place)
        kind = np.dtype((component, (width,)))
        count = self.whole(accessor, "count", place)
        view = self.entry("bufferViews", accessor.get("bufferView"), place)
        start = self.whole(accessor, "byteOffset", place, 0)
        stride = self.whole(view, "byteStride", place, kind.itemsize)
        if stride < kind.itemsize or (stride != kind.itemsize and stride not in _STRIDES):
            raise InputError(self.path, f"a stride of at least {kind.itemsize} bytes", f"{stride}", place)
        data = self.view(accessor.get("bufferView"), place)
        if not count or start + (count - 1) * stride + kind.itemsize > len(data):
            found = f"{count:,} rows of {stride} bytes in {len(data):,}"
            raise InputError(self.path, "rows inside the buffer", found, place)
        values = np.ndarray((count, width), component, data, start, (stride, kind.itemsize // width))
        if values.dtype.kind == "f" or not accessor.get("normalized", False):
            return values.astype(np.float64)
        return np.maximum(values / np.iinfo(values.dtype).max, -1)

    def size(self) -> int:
        """The bytes of all buffers.

        Raises:
            InputError: one cannot be read.
        """
        buffers = self.content.get("buffers", [])
        number = len(buffers) if isinstance(buffers, list) else 0
        read = [self._buffer(index, f"buffers[{index}]") for index in range(number)]
        return sum(len(data) for data in {id(data): data for data in read}.values())

    def view(self, index: object, place: str) -> memoryview:
        """The bytes of a buffer view.

        Raises:
            InputError: it does not exist, or does not fit its buffer.
        """
        view, place = self.entry("bufferViews", index, place), f"bufferViews[{index}]"
        buffer, number = self.entry("buffers", view.get("buffer"), place), view["buffer"]
        start, length = self.whole(view, "byteOffset", place, 0), self.whole(view, "byteLength", place)
        data = self._buffer(number, f"buffers[{number}]")
        limit = min(len(data), self.whole(buffer, "byteLength", f"buffers[{number}]"))
        if start + length > limit:
            raise InputError(self.path, f"a part of the {limit:,} bytes", f"{start:,} to {start + length:,}", place)
        return memoryview(data)[start : start + length]

    def _buffer(self, index: int, place: str) -> bytes:
        """The bytes of a buffer, read once."""
        if index not in self.read:
            buffer = self.entry("buffers", index, place)
            uri = buffer.get("uri")
            same = self.indices.setdefault(uri, index) if isinstance(uri, str) else index
            self.read[index] = self.read[same] if same in self.read else self._read_buffer(buffer, index, place)
        return self.read[index]

    def _read_buffer(self, buffer: dict[str, Any], index: int, place: str) -> bytes:
        """The bytes of a buffer: of the .glb itself, inside the text, or of a file beside it."""
        uri = buffer.get("uri")
        if uri is None:
            if self.body is None or index != 0:
                raise InputError(self.path, "a buffer with bytes", "none", place)
            return self.body
        if not isinstance(uri, str):
            raise InputError(self.path, "a text", f"{uri!r:.40}", f"{place}.uri")
        if uri.startswith(DATA):
            head, _, text = uri.partition(",")
            if not head.endswith(";base64"):
                raise InputError(self.path, "data in base64", f"{head[:40]!r}", f"{place}.uri")
            try:
                return base64.b64decode(text, validate=True)
            except (binascii.Error, ValueError) as error:
                raise InputError(self.path, "data in base64", str(error), f"{place}.uri") from error
        name = PurePosixPath(unquote(uri))
        if ":" in uri or "\\" in uri or "\0" in str(name) or name.is_absolute() or ".." in name.parts or not name.parts:
            raise InputError(self.path, "a file in the same folder", f"{uri[:60]!r}", f"{place}.uri")
        file = self.path.parent / name
        if not file.is_file():
            raise InputError(self.path, "a buffer whose file exists", f"{uri[:60]!r}", f"{place}.uri")
        return read_bytes(file)


def is_gltf(data: bytes) -> bool:
    """Whether bytes may be a glTF file: a GLB, or a JSON object with an asset."""
    return data[:4] == MAGIC or (data[:64].lstrip(b"\xef\xbb\xbf \t\r\n")[:1] == b"{" and b'"asset"' in data)


def open_container(path: Path, data: bytes) -> Container:
    """Take a glTF file apart.

    Args:
        path: the file, whose folder may have buffers.
        data: its bytes.

    Raises:
        InputError: it is damaged or of another version.
    """
    text, body = _chunks(path, data) if data[:4] == MAGIC else (data, None)
    with input_error(path, f"{EXPECTED} with JSON"):
        content = parse_json(text)
    asset = content.get("asset") if isinstance(content, dict) else None
    version = asset.get("version") if isinstance(asset, dict) else None
    if not isinstance(version, str) or not version.startswith(f"{VERSION}."):
        raise InputError(path, "glTF 2.0", f"{version!r:.40}", "asset.version")
    return Container(path, content, body)


def _chunks(path: Path, data: bytes) -> tuple[bytes, bytes | None]:
    """The JSON and the binary chunk of a GLB."""
    if len(data) < HEADER.size:
        raise InputError(path, EXPECTED, "the end of it inside the header")
    _, version, length = HEADER.unpack_from(data)
    if version != VERSION:
        raise InputError(path, "GLB of version 2", f"version {version}")
    if length != len(data):
        raise InputError(path, f"{length:,} bytes, as its header says", f"{len(data):,}")
    chunks, start = [], HEADER.size
    while start < len(data):
        if start + CHUNK.size > len(data):
            raise InputError(path, "chunks that are complete", "one that is cut off")
        size, kind = CHUNK.unpack_from(data, start)
        start += CHUNK.size
        if start + size > len(data):
            raise InputError(path, "chunks that are complete", "one that is cut off")
        chunks.append((kind, data[start : start + size]))
        start += size
    if not chunks or chunks[0][0] != b"JSON":
        raise InputError(path, "a first chunk with JSON", "another")
    body = chunks[1][1] if len(chunks) > 1 and chunks[1][0] == b"BIN\0" else None
    return chunks[0][1], body


@dataclass(frozen=True)
class GlbBuffer:
    """The buffer of a .glb that is being written.

    Attributes:
        data: its bytes.
        views: its buffer views.
        accessors: its accessors.
    """

    data: bytearray = field(default_factory=bytearray)
    views: list[dict[str, Any]] = field(default_factory=list)
    accessors: list[dict[str, Any]] = field(default_factory=list)

    def add(self, values: np.ndarray, target: int | None = None, *, bounds: bool = False) -> int:
        """Append an array [n] or [n k] and return the number of its accessor; bytes stand for 0 to 1.

        Args:
            values: of a type that glTF has, in rows of whole words of four bytes if they are attributes.
            target: of its buffer view: `VERTICES`, `INDICES` or None.
            bounds: whether the accessor has the smallest and largest values, as positions must.
        """
        width = values.shape[1] if values.ndim == 2 else 1
        (kind,) = (name for name, numbers in _TYPES.items() if numbers == width)
        (component,) = (number for number, dtype in _COMPONENTS.items() if dtype == values.dtype)
        view = self.add_bytes(values.tobytes(), target)
        accessor = {"bufferView": view, "componentType": component, "count": len(values), "type": kind}
        if values.dtype == np.uint8:
            accessor["normalized"] = True
        if bounds:
            accessor |= {"min": values.min(0).tolist(), "max": values.max(0).tolist()}
        self.accessors.append(accessor)
        return len(self.accessors) - 1

    def add_bytes(self, data: bytes, target: int | None = None) -> int:
        """Append bytes, padded to whole words, and return the number of their buffer view."""
        view = {"buffer": 0, "byteOffset": len(self.data), "byteLength": len(data)}
        self.views.append(view if target is None else view | {"target": target})
        self.data.extend(_padded(data, b"\0"))
        return len(self.views) - 1

    def content(self) -> dict[str, Any]:
        """What the JSON of the file says about it."""
        buffers = [{"byteLength": len(self.data)}]
        return {"accessors": self.accessors, "bufferViews": self.views, "buffers": buffers}


def write_glb(path: str | Path, content: dict[str, Any], buffer: GlbBuffer) -> None:
    """Write a .glb file.

    Args:
        path: the file.
        content: its JSON, with `buffer.content()`.
        buffer: its binary chunk.

    Raises:
        OSError: it cannot be written.
    """
    text = _padded(json.dumps(content, separators=(",", ":"), allow_nan=False).encode(), b" ")
    chunks = b"".join(CHUNK.pack(len(data), kind) + data for kind, data in ((b"JSON", text), (b"BIN\0", buffer.data)))
    write_bytes(path, HEADER.pack(MAGIC, VERSION, HEADER.size + len(chunks)) + chunks)


def _padded(data: bytes, padding: bytes) -> bytes:
    """Bytes, filled to whole words of four."""
    return data + padding * (-len(data) % 4)
