"""Read and write .glb files (binary glTF 2.0), limited to what furniture needs: triangles, one set of texture coordinates, base colours."""

from __future__ import annotations

import json
import struct
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from jaxtyping import Float32, Int64

from semgs.files.atomic import write_bytes
from semgs.files.errors import InputError
from semgs.files.strict_json import parse_json

HEADER, JSON_CHUNK, BINARY_CHUNK = b"glTF", 0x4E4F534A, 0x004E4942
TRIANGLES = 4
SHORT, LONG, FLOAT = 5123, 5125, 5126
COMPONENTS: dict[int, str] = {5121: "u1", SHORT: "<u2", LONG: "<u4", FLOAT: "<f4"}
WIDTHS = {"SCALAR": 1, "VEC2": 2, "VEC3": 3, "VEC4": 4}


@dataclass(frozen=True)
class Primitive:
    """Triangles of one material.

    Attributes:
        name: of the node that holds them.
        material: the material's name.
        vertices: in the file's own frame [m].
        faces: three vertex indices per triangle.
        uv: texture coordinates of the vertices, (0, 0) at the image's upper left; zeros if there is no texture.
        colour: linear RGB, multiplied with the texture.
        texture: the encoded image, None if there is none.
        clear: whether the material is transparent.
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
        InputError: it is not a .glb file, or uses unsupported features (node transforms, sparse or compressed data, anything but
            triangles).
    """
    raw = path.read_bytes()
    try:
        return _primitives(*_chunks(raw))
    except (KeyError, IndexError, ValueError, TypeError, struct.error) as error:
        expected, reason = "a binary glTF 2.0 file of plain triangles", f"{type(error).__name__}: {error}"
        raise InputError(path, expected, reason, advice="fetch it again") from error


def _chunks(raw: bytes) -> tuple[dict, bytes]:
    """The JSON description and the binary data."""
    magic, version, length = struct.unpack_from("<4sII", raw)
    if magic != HEADER or version != 2 or length != len(raw):
        raise ValueError(f"header {magic!r}, version {version}, {length} bytes of {len(raw)}")
    chunks, place = {}, 12
    while place < length:
        size, kind = struct.unpack_from("<II", raw, place)
        chunks[kind] = raw[place + 8 : place + 8 + size]
        place += 8 + size
    return parse_json(chunks[JSON_CHUNK]), chunks.get(BINARY_CHUNK, b"")


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
        raise ValueError(f"a face refers to vertex {faces.max()} of {len(vertices)}")
    material = description["materials"][primitive["material"]] if "material" in primitive else {}
    surface = material.get("pbrMetallicRoughness", {})
    red, green, blue = (float(c) for c in surface.get("baseColorFactor", (1, 1, 1, 1))[:3])
    texture = None
    uv = np.zeros((len(vertices), 2), np.float32)
    if "baseColorTexture" in surface and "TEXCOORD_0" in attributes:
        image = description["images"][description["textures"][surface["baseColorTexture"]["index"]]["source"]]
        texture = _view(description, data, image["bufferView"])
        uv = _accessor(description, data, attributes["TEXCOORD_0"])
    clear = material.get("alphaMode", "OPAQUE") == "BLEND"
    return Primitive(name, str(material.get("name", "")), vertices, faces, uv, (red, green, blue), texture, clear)


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


def write_glb(path: Path, primitives: Sequence[Primitive]) -> None:
    """Write primitives for `read_glb`: one node, mesh and material each; the images are embedded, equal ones once.

    Raises:
        ValueError: a texture is neither JPEG nor PNG.
        OSError: the file cannot be written.
    """
    data = bytearray()
    views: list[dict] = []
    accessors: list[dict] = []
    images: dict[bytes, int] = {}
    meshes, materials, nodes = [], [], []

    def view(raw: bytes) -> int:
        views.append({"buffer": 0, "byteOffset": len(data), "byteLength": len(raw)})
        data.extend(raw + bytes(-len(raw) % 4))
        return len(views) - 1

    def accessor(values: np.ndarray, component: int, kind: str, **bounds: list[float]) -> int:
        raw = np.ascontiguousarray(values, dtype=COMPONENTS[component]).tobytes()
        place = {"bufferView": view(raw), "componentType": component}
        accessors.append({**place, "count": len(values), "type": kind, **bounds})
        return len(accessors) - 1

    for number, primitive in enumerate(primitives):
        bounds = {"min": primitive.vertices.min(axis=0).tolist(), "max": primitive.vertices.max(axis=0).tolist()}
        attributes = {"POSITION": accessor(primitive.vertices, FLOAT, "VEC3", **bounds)}
        surface: dict = {"baseColorFactor": [*primitive.colour, 1.0], "metallicFactor": 0.0, "roughnessFactor": 0.8}
        if primitive.texture is not None:
            attributes["TEXCOORD_0"] = accessor(primitive.uv, FLOAT, "VEC2")
            surface["baseColorTexture"] = {"index": images.setdefault(primitive.texture, len(images))}
        component = SHORT if len(primitive.vertices) < 65536 else LONG
        indices = accessor(primitive.faces.ravel(), component, "SCALAR")
        meshes.append({"primitives": [{"attributes": attributes, "indices": indices, "material": number}]})
        material = {"name": primitive.material, "pbrMetallicRoughness": surface, "doubleSided": True}
        materials.append(material | ({"alphaMode": "BLEND"} if primitive.clear else {}))
        nodes.append({"name": primitive.name, "mesh": number})
    pictures = [{"bufferView": view(raw), "mimeType": _mime(raw)} for raw in images]
    description = {
        "asset": {"version": "2.0", "generator": "semgs"}, "scene": 0, "scenes": [{"nodes": list(range(len(nodes)))}],
        "nodes": nodes, "meshes": meshes, "materials": materials, "accessors": accessors, "bufferViews": views,
        "buffers": [{"byteLength": len(data)}],
    }  # fmt: skip
    if pictures:
        description |= {"images": pictures, "textures": [{"source": number} for number in range(len(pictures))]}
    head = json.dumps(description, separators=(",", ":")).encode()
    head += b" " * (-len(head) % 4)
    chunks = ((JSON_CHUNK, head), (BINARY_CHUNK, data))
    body = b"".join(struct.pack("<II", len(chunk), kind) + chunk for kind, chunk in chunks)
    write_bytes(path, struct.pack("<4sII", HEADER, 2, 12 + len(body)) + body)


def _mime(raw: bytes) -> str:
    for start, kind in ((b"\xff\xd8", "image/jpeg"), (b"\x89PNG", "image/png")):
        if raw.startswith(start):
            return kind
    raise ValueError("a texture is neither JPEG nor PNG")
