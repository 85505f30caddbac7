"""Reading binary glTF files, for tests: strict about what the format demands of containers, buffers and accessors."""

from __future__ import annotations

import json
import struct
from dataclasses import dataclass
from pathlib import Path

import numpy as np

FLOAT, BYTE = 5126, 5121
WIDTHS = {"SCALAR": 1, "VEC2": 2, "VEC3": 3, "VEC4": 4}


@dataclass(frozen=True)
class Glb:
    """The two parts of a file."""

    content: dict
    body: bytes

    @property
    def primitive(self) -> dict:
        """The only primitive of the only mesh."""
        mesh = self.content["meshes"][0]
        (primitive,) = mesh["primitives"]
        return primitive

    def attribute(self, name: str) -> np.ndarray:
        """The values of an attribute, [g n]."""
        accessor = self.content["accessors"][self.primitive["attributes"][name]]
        view = self.content["bufferViews"][accessor["bufferView"]]
        assert "byteStride" not in view
        assert not accessor.get("byteOffset")
        kind = {FLOAT: np.dtype("<f4"), BYTE: np.dtype("u1")}[accessor["componentType"]]
        shape = accessor["count"], WIDTHS[accessor["type"]]
        # Rules of glTF 2.0, 3.6.2: offsets are multiples of the component's size, and of 4 for vertex attributes, rows as well.
        assert view["byteOffset"] % 4 == shape[1] * kind.itemsize % 4 == 0
        assert view["byteLength"] == shape[0] * shape[1] * kind.itemsize
        assert view["byteOffset"] + view["byteLength"] <= len(self.body)
        return np.frombuffer(self.body, kind, shape[0] * shape[1], view["byteOffset"]).reshape(shape)


def read_glb(path: Path) -> Glb:
    """The file, taken apart by the rules of glTF 2.0, chapter 4."""
    data = path.read_bytes()
    assert struct.unpack_from("<4sII", data) == (b"glTF", 2, len(data))
    chunks = []
    at = 12
    while at < len(data):
        length, kind = struct.unpack_from("<I4s", data, at)
        assert length % 4 == 0
        chunks.append((kind, data[at + 8 : at + 8 + length]))
        assert len(chunks[-1][1]) == length
        at += 8 + length
    assert [kind for kind, _ in chunks] == [b"JSON", b"BIN\0"]
    (_, text), (_, body) = chunks
    assert text[:1] == b"{"
    assert text.rstrip(b" ")[-1:] == b"}"
    content = json.loads(text)
    (buffer,) = content["buffers"]
    assert "uri" not in buffer
    assert 0 <= len(body) - buffer["byteLength"] <= 3
    assert not any(body[buffer["byteLength"] :])
    return Glb(content, body)
