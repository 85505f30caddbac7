"""Furniture in .glb files (binary glTF 2.0), limited to what furniture needs: triangles, one set of texture coordinates, base colours."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from jaxtyping import Float32, Int64

from semgs.files.errors import InputError
from semgs.files.gltf_container import Container, GlbBuffer, open_container, write_glb

TRIANGLES = 4


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


def read_primitives(path: Path) -> list[Primitive]:
    """The primitives of a file, in its order.

    Raises:
        InputError: it is no glTF file, or uses unsupported features (node transforms, sparse or compressed data, anything but
            triangles).
    """
    raw = path.read_bytes()
    try:
        return _primitives(open_container(path, raw))
    except (KeyError, IndexError, ValueError, TypeError) as error:
        reason = str(error) if isinstance(error, InputError) else f"{type(error).__name__}: {error}"
        expected = "a binary glTF 2.0 file of plain triangles"
        raise InputError(path, expected, reason, advice="fetch it again") from error


def _primitives(file: Container) -> list[Primitive]:
    description = file.content
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
            result.append(_primitive(file, str(node.get("name", "")), primitive))
    return result


def _primitive(file: Container, name: str, primitive: dict) -> Primitive:
    description, attributes = file.content, primitive["attributes"]
    vertices = file.array(attributes["POSITION"], name).astype(np.float32)
    if "indices" in primitive:
        faces = file.array(primitive["indices"], name).astype(np.int64).reshape(-1, 3)
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
        texture = bytes(file.view(image["bufferView"], name))
        uv = file.array(attributes["TEXCOORD_0"], name).astype(np.float32)
    clear = material.get("alphaMode", "OPAQUE") == "BLEND"
    return Primitive(name, str(material.get("name", "")), vertices, faces, uv, (red, green, blue), texture, clear)


def write_primitives(path: Path, primitives: Sequence[Primitive]) -> None:
    """Write primitives for `read_primitives`: one node, mesh and material each; the images are embedded, equal ones once.

    Raises:
        ValueError: a texture is neither JPEG nor PNG.
        OSError: the file cannot be written.
    """
    buffer = GlbBuffer()
    images: dict[bytes, int] = {}
    meshes, materials, nodes = [], [], []
    for number, primitive in enumerate(primitives):
        attributes = {"POSITION": buffer.add(primitive.vertices.astype("<f4"), bounds=True)}
        surface: dict = {"baseColorFactor": [*primitive.colour, 1.0], "metallicFactor": 0.0, "roughnessFactor": 0.8}
        if primitive.texture is not None:
            attributes["TEXCOORD_0"] = buffer.add(primitive.uv.astype("<f4"))
            surface["baseColorTexture"] = {"index": images.setdefault(primitive.texture, len(images))}
        indices = buffer.add(primitive.faces.ravel().astype("<u2" if len(primitive.vertices) < 65536 else "<u4"))
        meshes.append({"primitives": [{"attributes": attributes, "indices": indices, "material": number}]})
        material = {"name": primitive.material, "pbrMetallicRoughness": surface, "doubleSided": True}
        materials.append(material | ({"alphaMode": "BLEND"} if primitive.clear else {}))
        nodes.append({"name": primitive.name, "mesh": number})
    pictures = [{"bufferView": buffer.add_bytes(raw), "mimeType": _mime(raw)} for raw in images]
    description = {
        "asset": {"version": "2.0", "generator": "semgs"}, "scene": 0, "scenes": [{"nodes": list(range(len(nodes)))}],
        "nodes": nodes, "meshes": meshes, "materials": materials, **buffer.content(),
    }  # fmt: skip
    if pictures:
        description |= {"images": pictures, "textures": [{"source": number} for number in range(len(pictures))]}
    write_glb(path, description, buffer)


def _mime(raw: bytes) -> str:
    for start, kind in ((b"\xff\xd8", "image/jpeg"), (b"\x89PNG", "image/png")):
        if raw.startswith(start):
            return kind
    raise ValueError("a texture is neither JPEG nor PNG")
