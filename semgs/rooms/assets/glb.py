"""Reading .glb files (glTF 2.0, binary) as far as furniture needs it: triangles, one set of texture coordinates, base colours."""

from __future__ import annotations

import json
import struct
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from jaxtyping import Float32, Int64

from semgs.files.errors import InputError

HEADER, JSON_CHUNK, BINARY_CHUNK = b"glTF", 0x4E4F534A, 0x004E4942
TRIANGLES = 4
COMPONENTS: dict[int, str] = {5121: "u1", 5123: "<u2", 5125: "<u4", 5126: "<f4"}
WIDTHS = {"SCALAR": 1, "VEC2": 2, "VEC3": 3, "VEC4": 4}


@dataclass(frozen=True)
class Primitive:
    """Triangles of one material.

    Attributes:
        name: of the node that holds them.
        material: the material's name.
        vertices: in the file's own frame [m].
        faces: three vertex numbers a triangle.
        uv: texture coordinates of the vertices, (0, 0) at the picture's upper left; zeros where there is no texture.
        colour: linear RGB that the texture is multiplied with.
        texture: the encoded picture, None if there is none.
        clear: whether the material is one to see through.
    """

    name: str
    material: str
    vertices: Float32[np.ndarray, "n 3"]
    faces: Int64[np.ndarray, "t 3"]
    uv: Float32[np.ndarray, "n 2"]
    colour: tuple[float, float, float]
    texture: bytes | None
    clear: bool


def read_glb(path: Path) -> list[Primitive]:
    """The primitives of a file, in its order.

    Raises:
        InputError: it is no such file, or uses what this reader does not know (node transforms, sparse or compressed data,
            anything but triangles).
    """
    raw = path.read_bytes()
    try:
        return _primitives(*_chunks(raw))
    except (KeyError, IndexError, ValueError, TypeError, struct.error) as error:
        raise InputError(
            path,
            "a binary glTF 2.0 file of plain triangles",
            f"{type(error).__name__}: {error}",
            advice="fetch it again",
        ) from error


def _chunks(raw: bytes) -> tuple[dict, bytes]:
    """The description and the data."""
    magic, version, length = struct.unpack_from("<4sII", raw)
    if magic != HEADER or version != 2 or length != len(raw):
        raise ValueError(f"header {magic!r}, version {version}, {length} bytes of {len(raw)}")
    chunks, place = {}, 12
    while place < length:
        size, kind = struct.unpack_from("<II", raw, place)
        chunks[kind] = raw[place + 8 : place + 8 + size]
        place += 8 + size
    return json.loads(chunks[JSON_CHUNK]), chunks.get(BINARY_CHUNK, b"")


def _primitives(description: dict, data: bytes) -> list[Primitive]:
    if description.get("extensionsRequired"):
        raise ValueError(f"extensions {description['extensionsRequired']}")
    result = []
    for node in description["nodes"]:
        if {"matrix", "translation", "rotation", "scale"} & node.keys():
            raise ValueError(f"node {node.get('name')!r} has a transform")
        if "mesh" not in node:
            continue
        for primitive in description["meshes"][node["mesh"]]["primitives"]:
            if primitive.get("mode", TRIANGLES) != TRIANGLES:
                raise ValueError(f"mode {primitive['mode']}")
            result.append(_primitive(description, data, str(node.get("name", "")), primitive))
    return result


def _primitive(description: dict, data: bytes, name: str, primitive: dict) -> Primitive:
    attributes = primitive["attributes"]
    vertices = _accessor(description, data, attributes["POSITION"])
    if "indices" in primitive:
        faces = _accessor(description, data, primitive["indices"]).astype(np.int64).reshape(-1, 3)
    else:
        faces = np.arange(len(vertices)).reshape(-1, 3)
    if len(faces) and faces.max() >= len(vertices):
        raise ValueError(f"a face names vertex {faces.max()} of {len(vertices)}")
    material = description["materials"][primitive["material"]] if "material" in primitive else {}
    surface = material.get("pbrMetallicRoughness", {})
    red, green, blue = (float(c) for c in surface.get("baseColorFactor", (1, 1, 1, 1))[:3])
    texture = None
    uv = np.zeros((len(vertices), 2), np.float32)
    if "baseColorTexture" in surface and "TEXCOORD_0" in attributes:
        image = description["images"][description["textures"][surface["baseColorTexture"]["index"]]["source"]]
        texture = _view(description, data, image["bufferView"])
        uv = _accessor(description, data, attributes["TEXCOORD_0"])
    return Primitive(
        name,
        str(material.get("name", "")),
        vertices,
        faces,
        uv,
        (red, green, blue),
        texture,
        material.get("alphaMode", "OPAQUE") == "BLEND",
    )


def _view(description: dict, data: bytes, number: int) -> bytes:
    view = description["bufferViews"][number]
    if view.get("buffer", 0) != 0 or "byteStride" in view:
        raise ValueError("data in another file, or interleaved")
    start = view.get("byteOffset", 0)
    return data[start : start + view["byteLength"]]


def _accessor(description: dict, data: bytes, number: int) -> np.ndarray:
    accessor = description["accessors"][number]
    if "sparse" in accessor or "bufferView" not in accessor:
        raise ValueError("sparse data")
    dtype, width = COMPONENTS[accessor["componentType"]], WIDTHS[accessor["type"]]
    raw = _view(description, data, accessor["bufferView"])
    values = np.frombuffer(raw, np.dtype(dtype), accessor["count"] * width, accessor.get("byteOffset", 0))
    return values.reshape(-1, width) if width > 1 else values
